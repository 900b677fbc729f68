//! Checks of a new twin before any training: [`check`] in a test, `truetwin check` in a shell.
//!
//! ```
//! use truetwin::record::Drive;
//! use truetwin::twin::conformance::{Finding, Severity, check};
//! use truetwin::twins::CascadedTanks;
//!
//! let drive = Drive::new(4.0, ndarray::Array2::ones((50, 1)))?;
//! let worst = check(&CascadedTanks, &drive, 1).into_iter().max_by_key(|f: &Finding| f.severity);
//! assert!(worst.is_some_and(|finding| finding.severity < Severity::Failure));
//! # Ok::<(), truetwin::record::RecordError>(())
//! ```

mod points;
mod step;
#[cfg(test)]
mod tests;

pub(crate) use points::check_points;
pub(crate) use step::{StepLength, blamed_step, check_step, step_length};

use crate::math::{six_digits, thin_svd};
use crate::record::{Drive, Signal, check_sizes};
use crate::setting::{count, number};
use crate::twin::{
    DigitalTwin, Noise, PRIOR_DEVIATION, Parameter, ParameterSpace, SimulationError, combination,
};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Relative size under which a singular value counts as zero: this direction does not move the free run.
const FLAT: f64 = 1e-6;
/// Finding about outputs whose squares overflow.
const TOO_LARGE: &str = "not known: the outputs are too large to compute with; use larger units";
/// Noise draws of nearby parameters must agree to this part of their spread.
const PAIRED: f64 = 1e-2;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// The check passed.
    Pass,
    /// Worth knowing; the twin can be used.
    Warning,
    /// The twin breaks a rule that estimation relies on.
    Failure,
}

/// The outcome of one check.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Finding {
    /// Short name of the check.
    pub check: &'static str,
    /// Severity.
    pub severity: Severity,
    /// The result, and the remedy where there is one.
    pub message: String,
}

impl Finding {
    pub(crate) fn pass(check: &'static str, message: impl Into<String>) -> Self {
        Self::of(check, Ok(message.into()))
    }

    pub(crate) fn failure(check: &'static str, message: impl Into<String>) -> Self {
        Self::of(check, Err((Severity::Failure, message.into())))
    }

    pub(crate) fn warning(check: &'static str, message: impl Into<String>) -> Self {
        Self::of(check, Err((Severity::Warning, message.into())))
    }

    fn of(check: &'static str, outcome: Outcome) -> Self {
        let (severity, message) = match outcome {
            Ok(message) => (Severity::Pass, message),
            Err(found) => found,
        };
        Self {
            check,
            severity,
            message,
        }
    }
}

/// Message of a check that passed, or how severe its finding is.
type Outcome = Result<String, (Severity, String)>;

fn failed(message: impl Into<String>) -> Outcome {
    Err((Severity::Failure, message.into()))
}

fn warned(message: impl Into<String>) -> Outcome {
    Err((Severity::Warning, message.into()))
}

/// Runs every check under `drive`; `seed` draws the noise and the parameters.
///
/// 1. *parameters*: names, prior boxes and bounds make sense;
/// 2. *channels*: outputs have the declared shape, and sizes that can be computed with;
/// 3. *finite*: trajectories are finite at the centre and the corners of the prior box (up to 64 of them);
/// 4. *repeatable*: the same arguments give the same bits;
/// 5. *noise*: another sample gives another trajectory;
/// 6. *paired*: noise draws do not depend on θ (common random numbers);
/// 7. *identifiable*: no direction in θ leaves the free run unchanged, or moves it less than the noise does over the whole
///    prior (first order, centre of the prior, noise taken as white).
///
/// `truetwin check` adds *step*: half the step moves no output by more than its noise.
pub fn check(twin: &dyn DigitalTwin, drive: &Drive, seed: u64) -> Vec<Finding> {
    let space = twin.parameters();
    let setting = Setting {
        twin,
        drive,
        noise: Noise::new(seed, "check", 0),
        centre: space.centre(),
        space,
    };
    let mut findings = vec![Finding::of("parameters", setting.parameters())];
    if findings[0].severity > Severity::Pass {
        return findings;
    }
    let first = match setting.run(&setting.centre) {
        Ok(outputs) => outputs,
        Err(error) => {
            let message = format!(
                "at the prior's centre {}: {error}",
                setting.written(&setting.centre)
            );
            findings.push(Finding::failure("finite", message));
            return findings;
        }
    };
    findings.push(Finding::of("channels", setting.channels(&first)));
    if findings[1].severity > Severity::Pass {
        return findings;
    }
    let other = twin.simulate(&setting.centre, drive, Noise::new(seed, "check", 1));
    let spread = other.map_or(0.0, |other| rms(&first, &other));
    findings.push(Finding::of("finite", setting.finite()));
    let repeatable = Finding::of("repeatable", setting.repeatable(&first));
    let repeats = repeatable.severity == Severity::Pass;
    findings.push(repeatable);
    findings.push(Finding::of("noise", noisy(spread)));
    // A study may hold all parameters; runs that do not repeat say nothing of their changes.
    if repeats && !setting.space.is_empty() {
        findings.push(Finding::of("paired", setting.paired(&first, spread)));
        findings.push(Finding::of("identifiable", setting.identifiable(spread)));
    }
    findings
}

/// A twin and the run that it is checked by.
struct Setting<'a> {
    twin: &'a dyn DigitalTwin,
    drive: &'a Drive,
    noise: Noise,
    space: ParameterSpace,
    centre: Vec<f64>,
}

impl Setting<'_> {
    fn run(&self, theta: &[f64]) -> Result<Signal, SimulationError> {
        self.twin.simulate(theta, self.drive, self.noise)
    }

    /// A point in words: `a = 1.5, b = 2`.
    fn written(&self, theta: &[f64]) -> String {
        let values = self.space.iter().zip(theta);
        let values =
            values.map(|(p, value)| format!("{} = {}", p.name, number(six_digits(*value))));
        values.collect::<Vec<_>>().join(", ")
    }

    fn parameters(&self) -> Outcome {
        let space = &self.space;
        if space.is_empty() {
            return Ok("none to estimate".to_owned());
        }
        match space.check() {
            Err(error) => failed(error.to_string()),
            Ok(()) => Ok(format!(
                "{} to estimate: {}",
                space.len(),
                space.names().join(", ")
            )),
        }
    }

    fn channels(&self, first: &Signal) -> Outcome {
        let expected = (self.drive.samples(), self.twin.signals().outputs.len());
        if first.dim() != expected {
            return failed(format!(
                "outputs are {:?}, {expected:?} (samples, channels) were declared; return one row a sample and one column an output",
                first.dim()
            ));
        }
        if let Err(error) = check_sizes(first, "output", &self.twin.signals().outputs) {
            return failed(format!("at the prior's centre {error}"));
        }
        let (samples, outputs) = (count(expected.0, "sample"), count(expected.1, "output"));
        Ok(format!("{samples}, {outputs}"))
    }

    /// Corners of the prior box: all of them up to six parameters, 64 spread ones beyond.
    fn corners(&self) -> Vec<Vec<f64>> {
        let corner = |c: usize| {
            let end = |(j, p): (usize, &Parameter)| {
                // Beyond six parameters, Walsh codes keep the corners apart.
                let bit = if j < 6 {
                    c >> j & 1
                } else {
                    (c & (j + 1)).count_ones() as usize & 1
                };
                if bit == 1 {
                    p.prior.high()
                } else {
                    p.prior.low()
                }
            };
            self.space.iter().enumerate().map(end).collect()
        };
        (0..1usize << self.space.len().min(6)).map(corner).collect()
    }

    fn finite(&self) -> Outcome {
        let corners = self.corners();
        let mut bad = corners.iter().filter_map(|theta| {
            let (problem, is_redrawn) = match self.run(theta) {
                Ok(outputs) if outputs.iter().all(|v| v.is_finite()) => return None,
                Ok(_) => ("outputs are not finite".to_owned(), true),
                Err(error) => (error.to_string(), error.costs_one_run()),
            };
            Some((theta, problem, is_redrawn))
        });
        let Some((theta, problem, is_redrawn)) = bad.next() else {
            return Ok(format!(
                "finite at the {} corners of the prior",
                corners.len()
            ));
        };
        let (lost, all) = (bad.count() + 1, corners.len());
        let then = match is_redrawn {
            true => "such draws are redrawn: shrink the prior or the step",
            false => "this ends all work: mend the simulator",
        };
        let message = format!(
            "{problem} at the prior's corner {} ({lost} of {all} corners); {then}",
            self.written(theta)
        );
        let severity = match lost == all {
            true => Severity::Failure,
            false => Severity::Warning,
        };
        Err((severity, message))
    }

    fn repeatable(&self, first: &Signal) -> Outcome {
        match self.run(&self.centre) {
            Ok(again) if again == *first => Ok("the same arguments give the same bits".into()),
            Err(error) => failed(format!(
                "a second run with the same arguments failed: {error}"
            )),
            Ok(_) => failed(
                "two runs with the same arguments differ; take all randomness from the noise or seed that a run is given, and keep no state between runs",
            ),
        }
    }

    fn paired(&self, first: &Signal, spread: f64) -> Outcome {
        let mut moved = self.centre.clone();
        for (value, width) in moved.iter_mut().zip(self.space.widths()) {
            *value += 1e-9 * width;
        }
        match self.run(&moved).map(|y| rms(first, &y)) {
            Ok(change) if change <= PAIRED * spread || spread == 0.0 => {
                Ok("noise draws do not depend on θ".into())
            }
            Ok(change) if !change.is_finite() => warned(TOO_LARGE),
            Ok(change) => {
                let told = format!(
                    "1e-9 of the prior's width moves the outputs by {change:.1e} rms (noise: {spread:.1e})"
                );
                // Without noise, draws move nothing; the mean over a black box's draws moves by a sixth.
                let free = |theta: &[f64]| self.twin.free_run(theta, self.drive);
                let of_motion = (free(&self.centre).ok().zip(free(&moved).ok()))
                    .map_or(0.0, |(here, there)| rms(&here, &there));
                match of_motion > 0.5 * change {
                    true => warned(format!(
                        "{told}, and a run without noise, too: chaotic over so long a record, with many tops of the likelihood; take shorter records, or declare noise of the states"
                    )),
                    false => failed(format!(
                        "{told}: draws depend on θ; draw the same numbers in the same order for every θ, each source of noise by its own name"
                    )),
                }
            }
            Err(error) => failed(error.to_string()),
        }
    }

    /// Singular directions of the free run's Jacobian at the prior's centre, θ in units of the prior's width, against the
    /// noise: two noisy runs differ by `spread` rms.
    fn identifiable(&self, spread: f64) -> Outcome {
        let jacobian = match self.free_run_jacobian() {
            Ok(jacobian) => jacobian,
            Err(error) => return warned(format!("not known: {error}")),
        };
        // Columns of parameters that move nothing would leave the singular vectors of zeros to chance.
        let sizes: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
        let least = FLAT * sizes.iter().copied().fold(0.0, f64::max);
        let (moving, still): (Vec<usize>, Vec<usize>) =
            (0..sizes.len()).partition(|&j| sizes[j] > least || sizes[j].is_nan());
        let (names, jacobian) = (self.space.names(), jacobian.select_columns(&moving));
        let name = |j: &usize| names[*j];
        let moving: Vec<&str> = moving.iter().map(name).collect();
        let Some(svd) = thin_svd(&jacobian) else {
            return warned(TOO_LARGE);
        };
        let largest = svd.values.iter().copied().fold(0.0, f64::max);
        if largest == 0.0 {
            return warned(
                "the free run is the same for every θ: only noise can tell; take longer records or another input",
            );
        }
        // Standard deviation of the direction if the noise were white, in prior widths.
        let deviation = |s: f64| spread / 2f64.sqrt() / s;
        let named = |weak: &dyn Fn(f64) -> bool| -> Vec<String> {
            let chosen = (svd.values.iter().enumerate()).filter(|(_, s)| weak(**s));
            let words = chosen.map(|(i, _)| {
                let direction = svd.right.column(i).into_owned();
                combination(&moving, direction.as_slice())
            });
            words.collect()
        };
        let still = still.iter().map(|j| name(j).to_owned());
        let flat: Vec<String> = still.chain(named(&|s| s <= FLAT * largest)).collect();
        let drowned = named(&|s| s > FLAT * largest && deviation(s) > PRIOR_DEVIATION);
        if !flat.is_empty() {
            return warned(format!(
                "the free run does not change along {} (θ over the prior's width): only noise can tell; fix one parameter there, or report combinations",
                flat.join("; ")
            ));
        }
        if !drowned.is_empty() {
            return warned(format!(
                "a record of this length tells less than the prior about {} (θ over the prior's width): expect wide intervals there; take longer records or another input",
                drowned.join("; ")
            ));
        }
        let weakest = deviation(svd.values.min());
        Ok(format!(
            "every direction moves the free run (the weakest is known to about {weakest:.1e} prior widths)"
        ))
    }

    /// ∂(free run)/∂(θ over the prior's width) at the prior's centre, by central differences; N·channels × d.
    fn free_run_jacobian(&self) -> Result<DMatrix<f64>, SimulationError> {
        let widths = self.space.widths();
        let column = |j: usize| -> Result<DVector<f64>, SimulationError> {
            let side = |sign: f64| {
                let mut theta = self.centre.clone();
                theta[j] += sign * 1e-4 * widths[j];
                self.twin.free_run(&theta, self.drive)
            };
            let difference = side(1.0)? - side(-1.0)?;
            let slopes = difference.iter().map(|d| d / 2e-4);
            Ok(DVector::from_iterator(difference.len(), slopes))
        };
        let columns: Vec<DVector<f64>> = (0..self.space.len())
            .map(column)
            .collect::<Result<_, _>>()?;
        Ok(DMatrix::from_columns(&columns))
    }
}

fn noisy(spread: f64) -> Outcome {
    if spread > 0.0 {
        return Ok(format!("two noise samples differ by {spread:.3e} rms"));
    }
    warned(
        "the twin has no noise: statistics of features cannot be simulated; give it noise levels",
    )
}

/// Root mean square of a difference.
fn rms(a: &Signal, b: &Signal) -> f64 {
    ((a - b).mapv(|d| d * d).mean().unwrap_or(0.0)).sqrt()
}
