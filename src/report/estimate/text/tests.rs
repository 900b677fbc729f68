use super::*;
use crate::estimator::GateOutcome;
use crate::estimator::refine::Direction;
use crate::record::{Drive, Signal};
use crate::report::fixture::estimates;
use crate::study::RecordPlan;
use crate::twin::{DigitalTwin, Noise, ParameterSpace, SimulationError};

fn fits(text: &str) {
    assert!(text.lines().count() <= LINES, "{text}");
    assert!(text.lines().all(|line| length(line) <= COLUMNS), "{text}");
    assert!(!text.contains('\u{1b}'));
}

/// Lines as one, so that breaks do not matter.
fn joined(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn both_answers_of_the_gate_are_reported() {
    let found = estimates();
    let kept = estimate_text(&found.study, &found.kept);
    fits(&kept);
    let kept = joined(&kept);
    assert!(
        kept.contains("estimate kept") && !kept.contains("inconsistent"),
        "{kept}"
    );
    let refined = estimate_text(&found.study, &found.refined);
    fits(&refined);
    for expected in [
        "refitted",
        "start of x1",
        "90 % interval",
        " → ",
        "validation record",
    ] {
        assert!(refined.contains(expected), "{refined}");
    }
}

#[test]
fn an_incomplete_twin_is_reported() {
    let found = estimates();
    let mut estimate = found.refined.clone();
    let test = |p_value| GateOutcome {
        statistic: 9.0,
        p_value,
        p_error: 0.0,
        simulations: 199,
        alpha: 0.1,
        out_of_distribution: p_value <= 0.1,
    };
    for (after, expected) in [
        (
            Some(test(0.005)),
            "(p < 0.005, 199 simulations, false-alarm rate 10 %): no parameters compensate",
        ),
        (Some(test(0.5)), "is consistent with the record (p = 0.500)"),
        (None, "cannot be tested"),
    ] {
        estimate.refit_mut().after = after;
        let text = joined(&estimate_text(&found.study, &estimate));
        assert!(text.contains(expected), "{text}");
    }
}

/// Forty parameters with long names.
struct Many;
impl DigitalTwin for Many {
    fn parameters(&self) -> ParameterSpace {
        let name =
            |j| format!("a-very-long-name-of-a-parameter-{j}-on-some-long-target-and-magnitude");
        ParameterSpace::new((0..40).map(|j| Parameter::new(&name(j), "m^3/(kg s^2)", -1e-9, 1e9)))
    }
    fn simulate(&self, _: &[f64], _: &Drive, _: Noise) -> Result<Signal, SimulationError> {
        Err(SimulationError::fatal("never run"))
    }
}

#[test]
fn any_number_of_parameters_fits_the_terminal() {
    let study = Study::new("many", Many, RecordPlan::levels(0.1, 10, 0.0, 1.0, 5)).unwrap();
    let mut estimate = estimates().refined.clone();
    let space = study.twin().parameters();
    estimate.names = space.names().into_iter().map(str::to_owned).collect();
    estimate.roles = vec![Role::Parameter; 40];
    for all in [
        &mut estimate.initial.theta,
        &mut estimate.theta,
        &mut estimate.low,
        &mut estimate.high,
    ] {
        *all = vec![-1.234_567_89e8; 40];
    }
    estimate.std_error = vec![0.0123; 40];
    let weak = Direction {
        direction: vec![40f64.powf(-0.5); 40],
        std_error: 3.0,
        weak: true,
        combination: crate::twin::combination(&space.names(), &vec![40f64.powf(-0.5); 40]),
    };
    estimate.refit_mut().information.directions = vec![weak; 40];
    let text = estimate_text(&study, &estimate);
    fits(&text);
    assert!(
        text.contains("more; --json has them all") && text.contains("and 38 more"),
        "{text}"
    );
}
