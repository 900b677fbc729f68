//! Double and quadruple noise: regression coefficients are biased by it, a filter's score is not.

use super::likelihood::cramer_rao;
use super::{mean, pretrained, records, refined, runs, square, study};
use crate::evaluate::paper::Scenario;
use rayon::prelude::*;

/// Noise levels of each twin, to be multiplied.
fn noise(twin: &str, factor: f64) -> String {
    let levels: &[(&str, f64)] = match twin {
        // The increment's deviation a step: 0.05·√0.02.
        "van-der-pol" => &[("x2", 0.007_071_067_811_865_475)],
        _ => &[("h1", 0.1), ("h2", 0.1), ("y", 0.15)],
    };
    let lines = levels
        .iter()
        .map(|(name, level)| format!("{name} = {}\n", level * factor));
    format!("[noise]\n{}", lines.collect::<String>())
}

#[test]
#[ignore = "a study"]
fn errors_against_the_bound_as_noise_grows() {
    for (twin, regression) in [
        ("van-der-pol", "[features]\nkind = \"ar\"\norder = 5\n"),
        (
            "tanks",
            "[features]\nkind = \"arx\"\noutputs = 8\ninputs = 8\n",
        ),
    ] {
        for factor in [1.0, 2.0, 4.0] {
            for (kind, features) in [("score", ""), ("regression", regression)] {
                let study = study(twin, &format!("{features}{}", noise(twin, factor)));
                let estimator = pretrained(&study);
                let records = records(&study, Scenario::First, runs());
                let rows: Vec<[f64; 3]> = (records.par_iter().enumerate())
                    .map(|(run, (truth, record))| {
                        let estimate = refined(&estimator, record, run);
                        [
                            square(&estimate.fine.unwrap(), truth),
                            square(&estimate.gauss_newton.unwrap(), truth),
                            cramer_rao(&study, record, truth),
                        ]
                    })
                    .collect();
                let [fine, newton, bound] = [0, 1, 2].map(|k| mean(rows.iter().map(|r| r[k])));
                println!(
                    "{twin}, noise × {factor}, {kind}: TS-fine {fine:.2e}, Gauss–Newton {newton:.2e}, Cramér–Rao {bound:.2e}"
                );
                assert!(fine.is_finite());
            }
        }
    }
}
