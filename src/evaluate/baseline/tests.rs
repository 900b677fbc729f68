//! The same system in other units: the same answers, up to the units.

#[path = "../../../tests/science/numbers/chain.rs"]
#[allow(dead_code, reason = "shared with the tests of other rooms")]
mod chain;

use super::dual_ekf::DualStart;
use super::{DualFilter, PredictionErrorMethod};
use crate::record::{Quantity, Record};
use crate::study::{RecordPlan, Study};
use crate::twin::{DigitalTwin, Noise, Now, Outline, Parameter, ParameterSpace, StateSpace};
use chain::{Chain, Units};

/// Without ridge, until nothing is gained any more.
pub(super) fn converged() -> PredictionErrorMethod {
    PredictionErrorMethod {
        iterations: 200,
        ridge: 0.0,
        ..PredictionErrorMethod::default()
    }
}

const SAMPLES: usize = 240;

/// Parameters around 1e-9 and 1e9, outputs around 1e-6 and 1e6; and everything at once, steps of nanoseconds and of months included.
const UNITS: [Units; 4] = [
    Units {
        parameters: 1e-9,
        outputs: 1e6,
        ..Units::PLAIN
    },
    Units {
        parameters: 1e9,
        outputs: 1e-6,
        ..Units::PLAIN
    },
    Units {
        parameters: 1e9,
        states: 1e-9,
        inputs: 1e6,
        outputs: 1e-6,
        seconds: 1e-9,
    },
    Units {
        parameters: 1e-9,
        states: 1e9,
        inputs: 1e-6,
        outputs: 1e6,
        seconds: 1e8,
    },
];

/// `given` in other units is `plain`, within a share of itself.
fn same(what: &str, units: Units, given: f64, plain: f64, tolerance: f64) {
    let error = (given - plain).abs() / plain.abs().max(f64::MIN_POSITIVE);
    assert!(
        error < tolerance,
        "{what}: {given} for {plain}, in {units:?}"
    );
}

fn all(what: &str, units: Units, given: &[f64], plain: &[f64], unit: f64, tolerance: f64) {
    assert_eq!(given.len(), plain.len());
    for (given, plain) in given.iter().zip(plain) {
        same(what, units, given / unit, *plain, tolerance);
    }
}

/// The settings of the paper's baselines are in units of the twin's.
#[test]
fn baselines_do_not_depend_on_units() {
    let fit = |units: Units| {
        let chain = Chain::pair(units);
        let record = chain.record(1.5, SAMPLES, 6);
        let start: Vec<f64> = (0..2).map(|i| chain.rate(i)).collect();
        let converged = converged();
        let few = PredictionErrorMethod::default();
        let few = PredictionErrorMethod {
            ridge: few.ridge * (units.outputs / units.parameters).powi(2),
            ..few
        };
        let [converged, few] = [converged, few].map(|m| m.fit(&chain, &record, &start).unwrap());
        let plain = DualFilter::default();
        let filter = DualFilter {
            state_variance: plain.state_variance * units.states.powi(2),
            parameter_variance: plain.parameter_variance * units.parameters.powi(2),
            state_walk: plain.state_walk * units.states.powi(2),
            parameter_walk: plain.parameter_walk * units.parameters.powi(2),
            measurement: plain.measurement * units.outputs,
            start: DualStart::Twin,
        };
        let dual = filter.run(&chain, &record, &start).unwrap();
        [converged.theta, few.theta, dual.theta]
    };
    let plain = fit(Units::PLAIN);
    for units in UNITS {
        let given = fit(units);
        let unit = units.parameters;
        for (k, what) in ["converged", "six steps", "dual filter"].iter().enumerate() {
            all(what, units, &given[k], &plain[k], unit, 1e-4);
        }
    }
}
