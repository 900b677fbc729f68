//! The searches of a fit: of the twin without the effects of its study, then with them.

use super::axis::Axis;
use super::climb::Fitted;
use super::effects::Search;
use super::magnitude::{Kind, kinds, largest, size_axis};
use super::problem::Problem;
use super::starts::{base_fit, polish, search};
use crate::effect::Effect;
use crate::likelihood::Measured;
use crate::likelihood::kalman::{FilterError, recoverable};
use crate::record::{Record, Signal};
use crate::twin::{Noise, Role};
use std::collections::BTreeMap;

/// Iterations of each search: loud noise has a way to go.
pub(super) const ITERATIONS: usize = 80;

/// Ends of all searches.
pub(super) struct Searched<'a> {
    pub problem: Problem<'a>,
    /// Best first.
    pub fits: Vec<Fitted>,
    /// Log-likelihood of the twin with all effects off; none without effects that are fitted.
    pub without: Option<f64>,
    /// Kinds of the magnitudes of effects.
    pub kinds: BTreeMap<String, Kind>,
}

/// Fits a twin from all starts.
pub(super) fn searched<'a>(
    measured: &Measured,
    effects: &[Effect],
    records: &'a [Record],
    noise: Noise,
) -> Result<Searched<'a>, FilterError> {
    let plain = Problem::of_measured(measured, records);
    let space = measured.twin.parameters();
    if space.iter().all(|p| p.role != Role::Magnitude) {
        return Ok(Searched {
            fits: fits(&plain, &[], noise)?,
            problem: plain,
            without: None,
            kinds: BTreeMap::new(),
        });
    }
    let twin = &measured.twin;
    let without = off(&plain, &kinds(twin, effects, records, &[]));
    let base = fits(&without, &[], noise)?;
    let Some(base) = base.into_iter().next() else {
        return Ok(Searched {
            fits: fits(&plain, &[], noise)?,
            problem: plain,
            without: None,
            kinds: BTreeMap::new(),
        });
    };
    // Where the twin follows the record: thresholds on states are somewhere among these.
    let states: Vec<Signal> = match plain.is_simulated() {
        true => vec![],
        false => (recoverable(without.states(&base.theta))?
            .unwrap_or_default()
            .into_iter())
        .map(|(_, states)| states)
        .collect(),
    };
    let kinds = kinds(twin, effects, records, &states);
    let problem = scaled(&plain, &without, &kinds)?;
    let mut theta = base.theta.clone();
    for (j, parameter) in space.iter().enumerate() {
        if let Some(kind) = kinds.get(&parameter.name) {
            theta[j] = problem.axes[j].bounds.clamp(kind.off(parameter));
        }
    }
    let initial = match problem.is_simulated() {
        true => vec![theta],
        false => {
            let search = Search {
                problem: &problem,
                effects,
                kinds: &kinds,
                fit: &|problem, initial| fits(problem, initial, noise),
            };
            search.starts(&theta)?
        }
    };
    Ok(Searched {
        fits: fits(&problem, &initial, noise)?,
        problem,
        without: Some(base.log_likelihood),
        kinds,
    })
}

/// Fits from `initial`, from the prior's centre and from random points, best first.
fn fits(
    problem: &Problem<'_>,
    initial: &[Vec<f64>],
    noise: Noise,
) -> Result<Vec<Fitted>, FilterError> {
    let fits = match problem.is_simulated() {
        true => {
            let theta = initial.first().map(Vec::as_slice);
            base_fit(problem, theta, noise)?.into_iter().collect()
        }
        false => search(problem, initial, noise, ITERATIONS)?,
    };
    polish(problem, fits, ITERATIONS)
}

/// The problem with every effect held where it is off.
fn off<'a>(problem: &Problem<'a>, kinds: &BTreeMap<String, Kind>) -> Problem<'a> {
    with_axes(problem, |axis, j, space| {
        if let Some(kind) = kinds.get(&space[j].name) {
            axis.centre = kind.off(&space[j]);
            axis.held = true;
        }
    })
}

/// The problem with the magnitudes of effects in the units of the record. Sizes are told from the states where the twin without effects
/// follows the record with loud noise.
fn scaled<'a>(
    problem: &Problem<'a>,
    without: &Problem<'_>,
    kinds: &BTreeMap<String, Kind>,
) -> Result<Problem<'a>, FilterError> {
    let begin = without.begin(&without.centre());
    let states: Option<Vec<Signal>> = match problem.is_simulated() {
        true => None,
        false => recoverable(without.states(&begin))?
            .map(|all| all.into_iter().map(|(_, states)| states).collect()),
    };
    Ok(with_axes(problem, |axis, j, space| {
        let parameter = &space[j];
        match (kinds.get(&parameter.name), &states) {
            (Some(Kind::Size(_)), Some(states)) => {
                let entry = (j, parameter);
                let size = largest(&problem.twin, &begin, entry, problem.records, states);
                if let Some(size) = size {
                    *axis = size_axis(parameter, size);
                }
            }
            (Some(kind), _) => *axis = kind.axis(parameter),
            (None, _) => {}
        }
    }))
}

/// The problem with other axes.
fn with_axes<'a>(
    problem: &Problem<'a>,
    change: impl Fn(&mut Axis, usize, &crate::twin::ParameterSpace),
) -> Problem<'a> {
    let space = problem.twin.parameters();
    let mut axes = problem.axes[..space.len()].to_vec();
    for (j, axis) in axes.iter_mut().enumerate() {
        change(axis, j, &space);
    }
    Problem::new(problem.twin.clone(), axes, problem.records)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Catalogue, augment};
    use crate::fit::climb::climb;
    use crate::fit::starts::drawn;
    use crate::likelihood::{Beliefs, measured};
    use crate::record::Drive;
    use crate::twin::{Integrator, Now, Outline, Parameter, StateSpace, Twin};
    use std::path::Path;

    /// M·q̈ = F − Fv·q̇: the carriage of examples/rigs.rs.
    struct Carriage;

    impl StateSpace for Carriage {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("M", "kg", 50.0, 200.0).within(10.0, 1000.0))
                .parameter(Parameter::new("Fv", "N·s/m", 50.0, 1000.0).within(1.0, 5000.0))
                .state("q", "m")
                .state("v", "m/s")
                .input("F", "N")
                .output("y", "m")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            let [mass, friction] = [now.theta[0], now.theta[1]];
            dx[0] = x[1];
            dx[1] = (now.u[0] - friction * x[1]) / mass;
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y[0] = x[0];
        }
        fn noise(&self, _: &Now<'_>, _: &mut [f64], measurement: &mut [f64]) {
            measurement[0] = 1e-4;
        }
        fn integrator(&self) -> Integrator {
            Integrator::RungeKutta4
        }
    }

    fn friction() -> Vec<Effect> {
        let catalogue = Catalogue::default();
        ["coulomb-friction", "constant-forcing"]
            .map(|id| catalogue.effect(id, "v").unwrap())
            .into()
    }

    /// A run with dry friction and an offset of the force.
    fn simulated() -> Record {
        let twin = augment(Twin::new(Carriage), friction()).unwrap();
        let force = Signal::from_shape_fn((900, 1), |(k, _)| {
            let t = 0.02 * k as f64;
            70.0 * (1.3 * t).sin() + 30.0 * (4.1 * t).sin()
        });
        let drive = Drive::new(0.02, force).unwrap();
        let noise = Noise::new(1, "carriage", 0);
        let outputs = twin.simulate(&[95.0, 203.0, 0.22, 0.03], &drive, noise);
        Record::new(drive, outputs.unwrap()).unwrap()
    }

    /// The measured carriage at 20 ms, where it is at hand.
    fn real() -> Option<Record> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
        let record = Record::read(&path.join("emps-estimation.csv")).ok()?;
        let (u, y) = (record.drive().inputs(), record.outputs());
        let rows = record.samples() / 2;
        let force = |k: usize| 0.5 * (u[[2 * k, 0]] + u[[2 * k + 1, 0]]);
        let inputs = Signal::from_shape_fn((rows, 1), |(k, _)| force(k));
        let outputs = Signal::from_shape_fn((rows, 1), |(k, _)| y[[2 * k, 0]]);
        Record::new(Drive::new(0.02, inputs).unwrap(), outputs).ok()
    }

    /// Nine of ten starts drawn in the prior end at the best of all searches.
    #[test]
    fn a_start_in_the_prior_is_enough_for_the_carriage() {
        for record in [Some(simulated()), real()].into_iter().flatten() {
            let records = [record];
            let twin = augment(Twin::new(Carriage), friction()).unwrap();
            let beliefs = Beliefs {
                step: 0.02,
                ..Beliefs::default()
            };
            let measured = measured(&twin, &records, &beliefs).unwrap();
            let noise = Noise::new(0, "fit", 0);
            let found = searched(&measured, &friction(), &records, noise).unwrap();
            let (problem, best) = (&found.problem, &found.fits[0]);
            assert!(found.without.unwrap() < best.log_likelihood - 20.0);
            let space = problem.twin.parameters();
            let arrived = (0..10).filter(|seed| {
                let noise = Noise::new(*seed, "prior", 0);
                let theta = problem.full(&space.draw_prior(noise));
                let start = problem.begin(&drawn(problem, theta, noise));
                let fit = climb(problem, &start, ITERATIONS).unwrap();
                fit.is_some_and(|fit| fit.objective > best.objective - 0.5)
            });
            let arrived = arrived.count();
            assert!(arrived >= 9, "{arrived} of 10");
        }
    }
}
