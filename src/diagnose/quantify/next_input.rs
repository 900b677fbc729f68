//! The record to measure next, so that rivals are told apart.
//!
//! Inputs of several kinds, within the range of those that were applied, are tried on the fitted rivals: simulate one, filter
//! with all; what the innovations of two differ by, beyond what θ can answer, is what an input is worth (`reference.rs`). The best is
//! tried in earnest: each rival is fitted anew to the present records and a simulated next one together, and a record counts
//! as telling when the rival that made it leads all others by more than a class is wide.
//!
//! Source of the criterion: Hunter & Reiner, "Designs for discriminating between two rival models" (1965).

use crate::diagnose::outcome::NextInput;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::fit::climb::climb;
use crate::fit::evidence::{CREDIT, laplace};
use crate::fit::problem::Problem;
use crate::fit::reference::Reference;
use crate::hypothesis::search::model::{Model, keys};
use crate::likelihood::kalman::recoverable;
use crate::parallel::try_each;
use crate::record::{Drive, Record, Signal};
use crate::study::StudyError;
use crate::twin::Noise;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Iterations of a refit.
const WARM: usize = 4;

/// One input that could be applied.
struct Proposal {
    kind: String,
    drive: Drive,
}

/// A rival: a twin with an effect, and θ.
struct Rival {
    key: String,
    problem: Problem,
    theta: Vec<f64>,
    /// Information of the present records about θ, in φ.
    information: DMatrix<f64>,
}

/// The input that tells the members of a class apart best; `None` where none does better than the present one once more.
pub(in crate::diagnose) fn next_input(
    class: &[&Model],
    noise: Noise,
) -> Result<Option<NextInput>, StudyError> {
    let rivals: Vec<Rival> = (class.iter().take(THRESHOLDS.most_rivals))
        .map(|model| Rival {
            key: keys(&model.terms).join("+"),
            problem: model.problem.clone(),
            theta: model.fitted.theta.clone(),
            information: model.fitted.information.clone(),
        })
        .collect();
    if rivals.len() < 2 {
        return Ok(None);
    }
    let records = &rivals[0].problem.records.clone();
    let proof = noise.child("proof");
    let again = told_apart(
        &rivals,
        records,
        records[0].drive(),
        THRESHOLDS.proofs,
        proof,
    )?;
    let mut best: Option<([u64; 2], Proposal)> = None;
    for times in THRESHOLDS.lengths {
        let Some(proposal) = best_of(&rivals, records, times, noise)? else {
            continue;
        };
        let split = told_apart(&rivals, records, &proposal.drive, THRESHOLDS.proofs, proof)?;
        if split[0] > best.as_ref().map_or(again[0], |(most, _)| most[0]) {
            best = Some((split, proposal));
        }
        if 2 * split[0] > THRESHOLDS.proofs {
            break;
        }
    }
    Ok(best.map(|(split, proposal)| NextInput {
        drive: proposal.drive,
        kind: proposal.kind,
        rivals: rivals.into_iter().map(|rival| rival.key).collect(),
        split,
        again,
    }))
}

/// The best input of a record so many times as long as the present one.
fn best_of(
    rivals: &[Rival],
    records: &[Record],
    times: usize,
    noise: Noise,
) -> Result<Option<Proposal>, StudyError> {
    let looks = try_each(proposals(&records[0], times, noise)?, |proposal| {
        let nats = first_statistics(rivals, &proposal.drive, noise)?;
        Ok::<_, StudyError>((nats, proposal))
    })?;
    let best = (looks.into_iter()).max_by(|a, b| a.0.total_cmp(&b.0));
    Ok(best
        .filter(|(nats, _)| *nats > 0.0)
        .map(|(_, proposal)| proposal))
}

/// Inputs within the range of those of a record, so many times as long as it; without inputs, a longer record.
fn proposals(record: &Record, times: usize, noise: Noise) -> Result<Vec<Proposal>, StudyError> {
    let drive = record.drive();
    let (dt, samples) = (drive.dt(), times * drive.samples());
    let long = match times {
        1 => String::new(),
        _ => format!(", {times} times as long"),
    };
    let given = drive.inputs();
    let inputs = given.ncols();
    if inputs == 0 {
        let drive = Drive::autonomous(dt, samples)?.beginning_at(drive.first_time());
        return Ok(match times {
            1 => vec![],
            _ => vec![Proposal {
                kind: format!("{times} times as long"),
                drive,
            }],
        });
    }
    let range = |j: usize| {
        (given.column(j).iter()).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(*v), high.max(*v))
        })
    };
    let ranges: Vec<(f64, f64)> = (0..inputs).map(range).collect();
    // Shares of the range, by input and sample.
    let mut shapes: Vec<(String, Signal)> = vec![];
    for hold in THRESHOLDS
        .holds
        .map(|parts| (drive.samples() / parts).max(1))
    {
        let seconds = crate::math::six_digits(hold as f64 * dt);
        let mut source = noise.source(&format!("levels/{hold}"));
        let levels = Signal::from_shape_fn((samples.div_ceil(hold), inputs), |_| source.uniform());
        shapes.push((
            format!("levels held for {seconds} s"),
            Signal::from_shape_fn((samples, inputs), |(k, j)| levels[[k / hold, j]]),
        ));
        // Each input on its own beat, so that all combinations come.
        shapes.push((
            format!("full swings every {seconds} s"),
            Signal::from_shape_fn((samples, inputs), |(k, j)| {
                ((k / (hold * (j + 1))) % 2) as f64
            }),
        ));
    }
    let ramp = |k: usize| {
        let share = k as f64 / samples.max(2) as f64;
        1.0 - (2.0 * share - 1.0).abs()
    };
    shapes.push((
        "a slow ramp up and down".into(),
        Signal::from_shape_fn((samples, inputs), |(k, _)| ramp(k)),
    ));
    shapes.push((
        "a staircase up and down".into(),
        Signal::from_shape_fn((samples, inputs), |(k, _)| {
            (ramp(k) * THRESHOLDS.stairs as f64).floor() / (THRESHOLDS.stairs - 1) as f64
        }),
    ));
    (shapes.into_iter())
        .map(|(kind, shares)| {
            let values = Signal::from_shape_fn((samples, inputs), |(k, j)| {
                let (low, high) = ranges[j];
                low + shares[[k, j]].clamp(0.0, 1.0) * (high - low)
            });
            let drive = Drive::new(dt, values)?.beginning_at(drive.first_time());
            let kind = format!("{kind}{long}");
            Ok(Proposal { kind, drive })
        })
        .collect()
}

impl Rival {
    /// Simulates a record of this rival; `None` where it diverges.
    fn record(&self, drive: &Drive, noise: Noise) -> Result<Option<Record>, StudyError> {
        let theta = self.problem.of_record(0, &self.theta);
        match self.problem.twin.simulate(&theta, drive, noise) {
            // A black box may diverge without saying so.
            Ok(outputs) if outputs.iter().any(|v| !v.is_finite()) => Ok(None),
            Ok(outputs) => Ok(Some(Record::new(drive.clone(), outputs)?)),
            Err(error) if error.costs_one_run() => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Its evidence on the present records and another one together, fitted to both.
    fn evidence(&self, records: &Arc<[Record]>) -> Result<f64, StudyError> {
        let problem = self.problem.on(records.clone());
        let start = problem.carried(&self.problem, &self.theta);
        let fitted = climb(&problem, &start, WARM)?;
        let found = fitted.and_then(|fitted| laplace(&problem, &fitted, CREDIT));
        Ok(found.map_or(f64::NEG_INFINITY, |(log_evidence, _)| log_evidence))
    }
}

/// Difference of the closest two rivals in nats: half of what the change from the innovations of the one to those of the
/// other holds that θ of the other, as far as the present records leave it free, cannot imitate.
fn first_statistics(rivals: &[Rival], drive: &Drive, noise: Noise) -> Result<f64, StudyError> {
    let mut least = f64::INFINITY;
    for (i, truth) in rivals.iter().enumerate() {
        let noise = noise.child("look").sample(i as u64);
        let Some(record) = truth.record(drive, noise)? else {
            return Ok(0.0);
        };
        let records: Arc<[Record]> = Arc::from([record]);
        let at = |rival: &Rival| {
            let problem = rival.problem.on(records.clone());
            let theta = problem.full(&rival.problem.of_record(0, &rival.theta));
            (problem, theta)
        };
        let (problem, theta) = at(truth);
        let Some(own) = recoverable(problem.filtered(&theta))? else {
            return Ok(0.0);
        };
        for rival in rivals
            .iter()
            .enumerate()
            .filter(|(j, _)| *j != i)
            .map(|(_, r)| r)
        {
            let (problem, theta) = at(rival);
            let d = problem.dimension();
            let known = rival.information.view((0, 0), (d, d)).into_owned();
            // One rival's filter may not follow what another one made.
            let Some(reference) = Reference::knowing(&problem, &theta, &known)? else {
                return Ok(0.0);
            };
            least = least.min(0.5 * reference.own(&reference.direction(&own)));
        }
    }
    Ok(if least.is_finite() { least } else { 0.0 })
}

/// Counts the simulated records, each beside the present ones, of which the rival that made them leads all others by more than a
/// class is wide.
fn told_apart(
    rivals: &[Rival],
    records: &[Record],
    drive: &Drive,
    trials: u64,
    noise: Noise,
) -> Result<[u64; 2], StudyError> {
    let told = try_each(0..trials, |i| {
        let truth = (i % rivals.len() as u64) as usize;
        let Some(record) = rivals[truth].record(drive, noise.sample(i))? else {
            return Ok(false);
        };
        let both: Arc<[Record]> = [records, &[record]].concat().into();
        let scores: Vec<f64> = (rivals.iter())
            .map(|rival| rival.evidence(&both))
            .collect::<Result<_, StudyError>>()?;
        let others = scores.iter().enumerate().filter(|(j, _)| *j != truth);
        let next = others.map(|(_, s)| *s).fold(f64::NEG_INFINITY, f64::max);
        Ok::<_, StudyError>(scores[truth] > next + THRESHOLDS.rivals)
    })?;
    Ok([told.iter().filter(|t| **t).count() as u64, trials])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proposals_stay_within_what_was_applied() {
        let inputs = Signal::from_shape_fn((200, 2), |(k, j)| (k % 7) as f64 + 10.0 * j as f64);
        let record =
            Record::new(Drive::new(0.5, inputs).unwrap(), Signal::zeros((200, 1))).unwrap();
        let all = proposals(&record, 2, Noise::new(1, "t", 0)).unwrap();
        assert_eq!(all.len(), 2 * THRESHOLDS.holds.len() + 2);
        for proposal in all {
            let inputs = proposal.drive.inputs();
            for (j, (low, high)) in [(0.0, 6.0), (10.0, 16.0)].into_iter().enumerate() {
                assert!(inputs.column(j).iter().all(|v| (low..=high).contains(v)));
            }
        }
    }

    #[test]
    fn without_inputs_the_record_is_longer() {
        let record = Record::new(
            Drive::autonomous(0.5, 100).unwrap(),
            Signal::zeros((100, 1)),
        )
        .unwrap();
        let of = |times| proposals(&record, times, Noise::new(1, "t", 0)).unwrap();
        assert!(of(1).is_empty());
        assert_eq!(of(4)[0].drive.samples(), 400);
    }
}
