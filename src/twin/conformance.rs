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

use crate::math::deviation;
use crate::record::{Drive, Signal};
use crate::twin::{
    DigitalTwin, MOST_SUBSTEPS, Noise, Now, PRIOR_DEVIATION, Parameter, ParameterSpace,
    SimulationError, StateSpace, Twin, combination,
};
use nalgebra::DMatrix;
use serde::Serialize;

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
        Self::new(check, Severity::Pass, message)
    }

    pub(crate) fn failure(check: &'static str, message: impl Into<String>) -> Self {
        Self::new(check, Severity::Failure, message)
    }

    pub(crate) fn warning(check: &'static str, message: impl Into<String>) -> Self {
        Self::new(check, Severity::Warning, message)
    }

    fn new(check: &'static str, severity: Severity, message: impl Into<String>) -> Self {
        Self {
            check,
            severity,
            message: message.into(),
        }
    }
}

/// Relative size under which a singular value counts as zero: this direction does not move the free run.
const FLAT: f64 = 1e-6;
/// Noise draws of nearby parameters must agree to this part of their spread.
const PAIRED: f64 = 1e-2;

/// Runs every check under `drive`; `seed` draws the noise and the parameters.
///
/// 1. *parameters*: names, prior boxes and bounds make sense;
/// 2. *channels*: outputs have the declared shape;
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
    if let Err(error) = space.check() {
        return vec![Finding::failure("parameters", error.to_string())];
    }
    let names = space.names().join(", ");
    let mut findings = vec![Finding::pass(
        "parameters",
        format!("{} to estimate: {names}", space.len()),
    )];
    let setting = Setting {
        twin,
        drive,
        noise: Noise::new(seed, "check", 0),
        centre: space.centre(),
        space,
    };
    let first = match setting.run(&setting.centre) {
        Ok(outputs) => outputs,
        Err(error) => {
            let message = format!("at the prior's centre {:?}: {error}", setting.centre);
            findings.push(Finding::failure("finite", message));
            return findings;
        }
    };
    let expected = (drive.samples(), twin.signals().outputs.len());
    if first.dim() != expected {
        let message = format!(
            "outputs are {:?}, {expected:?} (samples, channels) were declared; return one row a sample and one column an output",
            first.dim()
        );
        findings.push(Finding::failure("channels", message));
        return findings;
    }
    let message = format!("{} samples, {} outputs", expected.0, expected.1);
    findings.push(Finding::pass("channels", message));
    findings.push(setting.finite());
    findings.push(setting.repeatable(&first));
    let other = twin.simulate(&setting.centre, drive, Noise::new(seed, "check", 1));
    let spread = other.map_or(0.0, |other| rms(&first, &other));
    findings.push(noisy(spread));
    findings.push(setting.paired(&first, spread));
    findings.push(setting.identifiable(spread));
    findings
}

/// Largest error of the step where no measurement noise is declared, as a share of an output's deviation.
const STEP_SHARE: f64 = 0.01;

/// Differences of the noise-free outputs at θ between one step and half of it, rms by output; none for a black box.
pub(crate) fn step_error(
    twin: &Twin,
    theta: &[f64],
    drive: &Drive,
) -> Result<Vec<(String, f64)>, SimulationError> {
    let Some(finer) = twin.stepped(|stepping| stepping.substeps *= 2) else {
        return Ok(vec![]);
    };
    let difference = twin.free_run(theta, drive)? - finer.free_run(theta, drive)?;
    let squares = difference.mapv(|d| d * d);
    Ok((twin.signals().outputs.into_iter().zip(squares.columns()))
        .map(|(output, squares)| (output.name, squares.mean().unwrap_or(0.0).sqrt()))
        .collect())
}

/// Compares the [`step_error`] at θ with the measurement noise of each output; `None` for a black box.
pub(crate) fn check_step(twin: &Twin, theta: &[f64], drive: &Drive) -> Option<Finding> {
    const CHECK: &str = "step";
    let equations = twin.equations()?;
    let errors = match step_error(twin, theta, drive) {
        Ok(errors) => errors,
        Err(error) => return Some(Finding::warning(CHECK, format!("not known: {error}"))),
    };
    let levels = match step_levels(equations, theta, drive) {
        Ok(levels) => levels,
        Err(error) => return Some(Finding::warning(CHECK, format!("not known: {error}"))),
    };
    let units = twin.signals().outputs.into_iter().map(|output| output.unit);
    let coarse: Vec<String> = (errors.iter().zip(&levels).zip(units))
        .filter(|((error, (level, _)), _)| error.1 > *level)
        .map(|(((name, error), (level, source)), unit)| {
            let (error, level) = (short(*error), short(*level));
            format!("{name} moves by {error} {unit} rms, {source} is {level} {unit}")
        })
        .collect();
    if coarse.is_empty() {
        return Some(Finding::pass(
            CHECK,
            "half the step moves no output by more than its noise",
        ));
    }
    let substeps = (4 * equations.stepping().substeps).min(MOST_SUBSTEPS);
    Some(Finding::warning(
        CHECK,
        format!(
            "too long: with half the step, {}; set [record] substeps = {substeps} in a study file, or use another integrator",
            coarse.join("; ")
        ),
    ))
}

/// Limit of each output's move, and the limit's name.
fn step_levels(
    twin: &dyn StateSpace,
    theta: &[f64],
    drive: &Drive,
) -> Result<Vec<(f64, &'static str)>, SimulationError> {
    let outline = twin.outline();
    let mut process = vec![0.0; outline.states.len()];
    let mut measurement = vec![0.0; outline.outputs.len()];
    let now = Now::new(0.0, drive.step(0), drive.input(0), theta);
    twin.noise(&now, &mut process, &mut measurement);
    let run = twin.run(theta, drive, Noise::OFF)?;
    let levels = measurement.iter().zip(run.columns());
    Ok(levels
        .map(|(noise, column)| match noise.abs() {
            noise if noise > 0.0 => (noise, "its noise"),
            _ => (
                STEP_SHARE * deviation(&column.to_vec()),
                "1 % of its deviation",
            ),
        })
        .collect())
}

/// A number to three digits.
pub(crate) fn short(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
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

    fn finite(&self) -> Finding {
        let corners = self.corners();
        let mut bad = corners.iter().filter_map(|theta| {
            let problem = match self.run(theta) {
                Ok(outputs) if outputs.iter().all(|v| v.is_finite()) => return None,
                Ok(_) => "outputs are not finite".to_owned(),
                Err(error) => error.to_string(),
            };
            Some((theta, problem))
        });
        let Some((theta, problem)) = bad.next() else {
            let message = format!("finite at the {} corners of the prior", corners.len());
            return Finding::pass("finite", message);
        };
        let (failed, all) = (bad.count() + 1, corners.len());
        let message = format!(
            "{problem} at the prior's corner {theta:?} ({failed} of {all} corners); such draws are redrawn: shrink the prior or the step"
        );
        if failed == all {
            Finding::failure("finite", message)
        } else {
            Finding::warning("finite", message)
        }
    }

    fn repeatable(&self, first: &Signal) -> Finding {
        match self.run(&self.centre) {
            Ok(again) if again == *first => {
                Finding::pass("repeatable", "the same arguments give the same bits")
            }
            _ => Finding::failure(
                "repeatable",
                "two runs with the same arguments differ; take all randomness from `noise` and keep no state between runs",
            ),
        }
    }

    fn paired(&self, first: &Signal, spread: f64) -> Finding {
        let mut moved = self.centre.clone();
        for (value, width) in moved.iter_mut().zip(self.space.widths()) {
            *value += 1e-9 * width;
        }
        match self.run(&moved).map(|y| rms(first, &y)) {
            Ok(change) if change <= PAIRED * spread || spread == 0.0 => {
                Finding::pass("paired", "noise draws do not depend on θ")
            }
            Ok(change) => Finding::failure(
                "paired",
                format!(
                    "1e-9 of the prior's width moves the outputs by {change:.1e} rms (noise: {spread:.1e}): draws depend on θ; open each source of noise by its own name and draw the same number of times"
                ),
            ),
            Err(error) => Finding::failure("paired", error.to_string()),
        }
    }

    /// Singular directions of the free run's Jacobian at the prior's centre, θ in units of the prior's width, against the
    /// noise: two noisy runs differ by `spread` rms.
    fn identifiable(&self, spread: f64) -> Finding {
        const CHECK: &str = "identifiable";
        let jacobian = match self.free_run_jacobian() {
            Ok(jacobian) => jacobian,
            Err(error) => return Finding::warning(CHECK, format!("not known: {error}")),
        };
        let svd = jacobian.svd(false, true);
        let largest = svd.singular_values.max();
        // Standard deviation of the direction if the noise were white, in prior widths.
        let deviation = |s: f64| spread / 2f64.sqrt() / s;
        let named = |weak: &dyn Fn(f64) -> bool| -> Vec<String> {
            let chosen = (svd.singular_values.iter().enumerate()).filter(|(_, s)| weak(**s));
            let words = chosen.filter_map(|(i, _)| {
                let row = svd.v_t.as_ref()?.row(i).transpose();
                Some(combination(&self.space.names(), row.as_slice()))
            });
            words.collect()
        };
        let flat = named(&|s| s <= FLAT * largest);
        let drowned = named(&|s| s > FLAT * largest && deviation(s) > PRIOR_DEVIATION);
        if !flat.is_empty() {
            let message = format!(
                "the free run does not change along {} (θ over the prior's width): only noise can tell; fix one parameter there, or report combinations",
                flat.join("; ")
            );
            return Finding::warning(CHECK, message);
        }
        if !drowned.is_empty() {
            let message = format!(
                "a record of this length tells less than the prior about {} (θ over the prior's width): expect wide intervals there; take longer records or another input",
                drowned.join("; ")
            );
            return Finding::warning(CHECK, message);
        }
        let weakest = deviation(svd.singular_values.min());
        let message = format!(
            "every direction moves the free run (the weakest is known to about {weakest:.1e} prior widths)"
        );
        Finding::pass(CHECK, message)
    }

    /// ∂(free run)/∂(θ over the prior's width) at the prior's centre, by central differences; N·channels × d.
    fn free_run_jacobian(&self) -> Result<DMatrix<f64>, SimulationError> {
        let widths = self.space.widths();
        let column = |j: usize| -> Result<Vec<f64>, SimulationError> {
            let side = |sign: f64| {
                let mut theta = self.centre.clone();
                theta[j] += sign * 1e-4 * widths[j];
                self.twin.free_run(&theta, self.drive)
            };
            let difference = side(1.0)? - side(-1.0)?;
            Ok(difference.iter().map(|d| d / 2e-4).collect())
        };
        let columns: Vec<Vec<f64>> = (0..self.space.len())
            .map(column)
            .collect::<Result<_, _>>()?;
        Ok(DMatrix::from_fn(columns[0].len(), columns.len(), |i, j| {
            columns[j][i]
        }))
    }
}

fn noisy(spread: f64) -> Finding {
    if spread > 0.0 {
        let message = format!("two noise samples differ by {spread:.3e} rms");
        return Finding::pass("noise", message);
    }
    Finding::warning(
        "noise",
        "the twin has no noise: statistics of features cannot be simulated; give it noise levels",
    )
}

/// Root mean square of a difference.
fn rms(a: &Signal, b: &Signal) -> f64 {
    ((a - b).mapv(|d| d * d).mean().unwrap_or(0.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{Quantity, Signals};
    use crate::twin::Outline;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    /// y = a·b·k/10 + noise, with a flaw.
    struct Flawed(Flaw, AtomicU64);
    #[derive(PartialEq)]
    enum Flaw {
        None,
        KeepsState,
        DrawsDependOnTheta,
        Diverges,
        Product,
    }
    impl DigitalTwin for Flawed {
        fn parameters(&self) -> ParameterSpace {
            ParameterSpace::new(["a", "b"].map(|n| Parameter::new(n, "", 1.0, 2.0)))
        }
        fn signals(&self) -> Signals {
            Signals {
                inputs: vec![],
                outputs: vec![Quantity::new("y", "")],
            }
        }
        fn simulate(
            &self,
            theta: &[f64],
            drive: &Drive,
            noise: Noise,
        ) -> Result<Signal, SimulationError> {
            let (a, b) = (theta[0], theta[1]);
            let mut source = noise.source("v");
            if self.0 == Flaw::DrawsDependOnTheta {
                source = noise.source(&format!("{a}"));
            }
            if self.0 == Flaw::Diverges && a * b > 3.9 {
                return Err(SimulationError::Diverged { at: 1.0 });
            }
            let calls = self.1.fetch_add(1, Ordering::Relaxed) as f64;
            let shift = if self.0 == Flaw::KeepsState {
                calls
            } else {
                0.0
            };
            Ok(Signal::from_shape_fn((drive.samples(), 1), |(k, _)| {
                let k = k as f64 / 10.0;
                let trend = 30.0
                    * if self.0 == Flaw::Product {
                        a * b * k
                    } else {
                        a * k + b * k * k
                    };
                trend + shift + source.normal()
            }))
        }
    }

    fn worst(flaw: Flaw) -> Vec<(&'static str, Severity)> {
        let drive = Drive::autonomous(0.1, 30).unwrap();
        check(&Flawed(flaw, AtomicU64::new(0)), &drive, 1)
            .into_iter()
            .filter(|f| f.severity > Severity::Pass)
            .map(|f| (f.check, f.severity))
            .collect()
    }

    #[test]
    fn each_flaw_is_found_and_a_good_twin_passes() {
        assert_eq!(worst(Flaw::None), []);
        assert!(worst(Flaw::KeepsState).contains(&("repeatable", Severity::Failure)));
        assert_eq!(
            worst(Flaw::DrawsDependOnTheta)[0],
            ("paired", Severity::Failure)
        );
        assert_eq!(worst(Flaw::Diverges), [("finite", Severity::Warning)]);
    }

    /// ẋ = −k·(x − u) from 0, y₁ = x with noise, y₂ = x without.
    struct Lag;
    impl StateSpace for Lag {
        fn outline(&self) -> Outline {
            Outline::new()
                .parameter(Parameter::new("k", "1/s", 0.1, 20.0))
                .state("x", "V")
                .input("u", "V")
                .output("y1", "V")
                .output("y2", "V")
        }
        fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
            dx[0] = now.theta[0] * (now.u[0] - x[0]);
        }
        fn observe(&self, _: &Now<'_>, x: &[f64], y: &mut [f64]) {
            y.fill(x[0]);
        }
        fn noise(&self, _: &Now<'_>, _: &mut [f64], measurement: &mut [f64]) {
            measurement[0] = 0.05;
        }
    }

    #[test]
    fn a_step_that_is_too_long_is_named_by_output() {
        let inputs = Signal::from_shape_fn((100, 1), |(k, _)| (k / 20 % 2) as f64);
        let drive = Drive::new(0.1, inputs).unwrap();
        let twin = Twin::new(Lag);
        let slow = check_step(&twin, &[0.1], &drive).unwrap();
        assert_eq!(slow.severity, Severity::Pass, "{}", slow.message);
        let stiff = check_step(&twin, &[15.0], &drive).unwrap();
        assert_eq!(stiff.severity, Severity::Warning);
        for part in [
            "y1 moves by",
            "its noise is 0.05 V",
            "y2 moves by",
            "1 % of its deviation is",
            "substeps = 4",
        ] {
            assert!(stiff.message.contains(part), "{}", stiff.message);
        }
        let errors = step_error(&twin, &[15.0], &drive).unwrap();
        assert_eq!(errors[1].0, "y2");
        assert!(errors[1].1 > 0.05, "{errors:?}");
        // What it advises helps.
        let finer = twin.stepped(|stepping| stepping.substeps = 64).unwrap();
        let fine = check_step(&finer, &[15.0], &drive).unwrap();
        assert_eq!(fine.severity, Severity::Pass, "{}", fine.message);
        let boxed: Arc<dyn DigitalTwin> = Arc::new(Flawed(Flaw::None, AtomicU64::new(0)));
        assert!(check_step(&Twin::from(boxed), &[1.0, 1.0], &drive).is_none());
    }

    /// A black box's mean over seeds cannot be flat to 1e-6, but a product's direction is: draws are paired.
    #[test]
    fn an_unidentifiable_product_is_named() {
        let drive = Drive::autonomous(0.1, 30).unwrap();
        let twin = Flawed(Flaw::Product, AtomicU64::new(0));
        let finding = check(&twin, &drive, 1).pop().unwrap();
        assert_eq!(finding.severity, Severity::Warning);
        assert!(
            finding.message.contains("0.71·a − 0.71·b"),
            "{}",
            finding.message
        );
    }
}
