//! Reasons to doubt an estimate.

use super::outcome::Estimate;
use super::record_fit::is_off;
use crate::estimator::budget::BUDGET;
use crate::estimator::gate::GateOutcome;
use crate::fit::doubts::{DIVERGES, beside};
use crate::fit::{Fit, NOT_CONVERGED, Warning};
use crate::math::{norm, three_digits};
use crate::record::{Quantity, Record, Signal};
use crate::setting::number;
use crate::twin::{Noise, PRIOR_DEVIATION, Role, Twin};

/// Lists what makes an estimate doubtful; `fit` is the likelihood's own, where there is one.
pub(super) fn warnings(
    twin: &Twin,
    record: &Record,
    estimate: &Estimate,
    fit: Option<&Fit>,
) -> Vec<Warning> {
    let signals = twin.signals();
    let mut all = Warning::still(&signals, std::slice::from_ref(record));
    match &estimate.tracking {
        Some(run) => {
            all.extend(Warning::no_better_of(
                &signals.outputs,
                record,
                &run.outputs,
            ));
            all.extend(noise_of_black_box(twin, record, estimate, &run.outputs));
        }
        None => all.push(Warning::new(
            DIVERGES,
            "the free run at the estimate diverges".to_owned(),
        )),
    }
    for level in &estimate.noise {
        let declared = three_digits(level.declared.unwrap_or(0.0));
        let what = format!(
            "the record shows a noise of {} of {} {}, {} is declared; simulations take what it shows",
            level.name,
            number(three_digits(level.value)),
            level.unit,
            number(declared),
        );
        all.push(Warning::new("noise-not-declared", what));
    }
    if estimate.refit().is_some_and(|refit| refit.is_refused) {
        let what = "refined parameters explain the record worse than the network's, which are kept";
        all.push(Warning::new("refinement-worse", what.to_owned()));
    }
    let space = twin.parameters();
    for (j, parameter) in space.iter().enumerate() {
        let side = parameter.bound_at(estimate.theta[j], estimate.std_error[j]);
        all.extend(side.map(|side| Warning::at_bound("at-bound", &parameter.name, side)));
    }
    if let Some(information) = estimate
        .information()
        .filter(|_| estimate.refit().is_none())
    {
        let leaning: Vec<&str> = (space.iter().zip(&information.std_error))
            .filter(|(p, error)| {
                let prior = PRIOR_DEVIATION * p.prior.width();
                // e² > share·(e² + p²), of sizes whose squares may vanish.
                let ratio = (prior / *error).powi(2);
                p.role == Role::Parameter && 1.0 > BUDGET.leaning * (1.0 + ratio)
            })
            .map(|(p, _)| p.name.as_str())
            .collect();
        if !leaning.is_empty() {
            let what = format!("{} lean on the prior", leaning.join(", "));
            all.push(Warning::new("leans-on-prior", what));
        }
    }
    let tests = [
        ("the test", Some(estimate.gate)),
        ("the test after the refit", estimate.after()),
    ];
    for (name, test) in tests {
        let Some(test) = test.filter(GateOutcome::is_unsure) else {
            continue;
        };
        let what = format!(
            "the p-value of {name}, {} ± {}, is near its level {}",
            number(three_digits(test.p_value)),
            number(three_digits(test.p_error)),
            number(test.alpha),
        );
        all.push(Warning::new("gate-near-level", what));
    }
    all.extend(Warning::step(twin, &estimate.theta, record, ""));
    let of_fit = fit.into_iter().flat_map(|fit| &fit.warnings);
    all.extend(of_fit.filter(|w| w.code == NOT_CONVERGED).cloned());
    all
}

/// Noise of outputs of a black box, which is simulated as it is: of a record that surely has another one, errors and tests say too little.
fn noise_of_black_box(
    twin: &Twin,
    record: &Record,
    estimate: &Estimate,
    run: &Signal,
) -> Vec<Warning> {
    if twin.outline().is_some() {
        return vec![];
    }
    let noise = Noise::new(0, "declared noise", 0);
    let Ok(noisy) = twin.simulate(&estimate.theta, record.drive(), noise) else {
        return vec![];
    };
    let told = |(j, output): (usize, &Quantity)| {
        let (values, shown) = beside(record, run, j);
        let own: Vec<f64> = (noisy.column(j).iter().zip(run.column(j)))
            .map(|(noisy, run)| noisy - run)
            .collect();
        let samples = values.len() as f64;
        let shown = norm(&shown) / samples.sqrt();
        let own = norm(&own) / (own.len() as f64).sqrt();
        let is_off = own > 0.0 && is_off(shown / own, samples.sqrt().recip());
        is_off.then(|| {
            let what = format!(
                "record and run differ by {} {} in {}, the simulator's own noise by {}, which errors and tests are told from",
                number(three_digits(shown)),
                output.unit,
                output.name,
                number(three_digits(own)),
            );
            Warning::new("noise-not-declared", what)
        })
    };
    let outputs = twin.signals().outputs;
    outputs.iter().enumerate().filter_map(told).collect()
}
