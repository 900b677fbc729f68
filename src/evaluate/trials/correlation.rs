//! A baseline: the signal that the residuals of the twin correlate with most.

use super::information::problem;
use super::law::DeparturePlace;
use super::places::TwinPlaces;
use super::world::{Conditions, System};
use crate::evaluate::trials::numbers::TRIAL;
use crate::fit::climb::climb;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::math::correlation;
use crate::record::Record;
use crate::study::Study;
use statrs::distribution::{ContinuousCDF, Normal};

/// Place of the signal that the next residual correlates with most; `None` where no correlation stands out, or for a black box.
pub(super) fn correlated(study: &Study, record: &Record) -> Result<Option<String>, FilterError> {
    let places = TwinPlaces::new(study.twin());
    if places.states.is_empty() {
        return Ok(None);
    }
    let records = std::slice::from_ref(record);
    let centre = study.twin().parameters().centre();
    let conditions = Conditions::declared();
    let system = System::new(&centre, &conditions);
    let (problem, _) = problem(study.twin(), study, system, records)?;
    let begin = problem.begin(&problem.centre());
    let Some(fitted) = climb(&problem, &begin, TRIAL.correlation_iterations)? else {
        return Ok(None);
    };
    let Some(seen) = recoverable(problem.states(&fitted.theta))? else {
        return Ok(None);
    };
    let Some((filtered, states)) = seen.into_iter().next() else {
        return Ok(None);
    };
    let inputs = record.drive().inputs();
    let (rows, outputs) = filtered.standardised.dim();
    let mut signals: Vec<(DeparturePlace, Vec<f64>)> = Vec::new();
    for place in places.all() {
        match place {
            DeparturePlace::State(i) => signals.push((place, states.column(i).to_vec())),
            DeparturePlace::Actuator(j) => signals.push((place, inputs.column(j).to_vec())),
            DeparturePlace::Sensor(_) => {
                signals.push((place, (0..rows).map(|k| k as f64).collect()))
            }
            DeparturePlace::Parameter(_) => {}
        }
    }
    let tests = (signals.len() * outputs).max(1) as f64;
    let mut best: Option<(f64, DeparturePlace)> = None;
    for (place, signal) in &signals {
        for j in 0..outputs {
            if matches!(place, DeparturePlace::Sensor(own) if *own != j) {
                continue;
            }
            let pairs: Vec<(f64, f64)> = (1..rows)
                .filter(|&k| !record.outputs()[[k, j]].is_nan())
                .map(|k| (signal[k - 1], filtered.standardised[[k, j]]))
                .collect();
            let size = correlation(&pairs).abs() * (pairs.len() as f64).sqrt();
            if best.is_none_or(|(most, _)| size > most) {
                best = Some((size, *place));
            }
        }
    }
    let threshold = Normal::standard().inverse_cdf(1.0 - 0.5 * TRIAL.correlation_level / tests);
    let best = best.filter(|(size, _)| *size > threshold);
    Ok(best.map(|(_, place)| places.name(place).to_owned()))
}
