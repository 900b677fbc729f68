//! Missing functions as they were fitted: values, errors, the range that the records show.

use crate::diagnose::outcome::MissingFunction;
use crate::diagnose::thresholds::THRESHOLDS;
use crate::hypothesis::basis::basis;
use crate::hypothesis::limits::TERM;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::term::Nature;
use nalgebra::{DMatrix, DVector};

/// Posterior of a fitted function of one variable: means and covariance of its values at points.
pub(in crate::diagnose) struct Curve {
    pub values: Vec<f64>,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
}

/// The curve of a model's last term; `None` for other terms than functions of one variable.
pub(in crate::diagnose) fn curve(model: &Model) -> Option<Curve> {
    let term = model.terms.last()?;
    let [variable] = term.variables.as_slice() else {
        return None;
    };
    let count = term.axes.len();
    let d = model.problem.twin.parameters().len();
    let theta = model.theta();
    let covariance = model.fitted.information.clone().try_inverse()?;
    let own = covariance
        .view((d - count, d - count), (count, count))
        .into_owned();
    let (_, a, b) = variable;
    let unseen = TERM.unseen() * (b - a);
    let (low, high, points) = (a + unseen, b - unseen, THRESHOLDS.function_points);
    let values: Vec<f64> = (0..points)
        .map(|i| low + (high - low) * i as f64 / (points - 1) as f64)
        .collect();
    let mut phi = DMatrix::zeros(points, count);
    for (i, value) in values.iter().enumerate() {
        for (k, value) in basis(*value, variable, count).into_iter().enumerate() {
            phi[(i, k)] = value;
        }
    }
    let beta = DVector::from_row_slice(&theta[d - count..]);
    Some(Curve {
        values,
        mean: &phi * beta,
        covariance: &phi * own * phi.transpose(),
    })
}

/// Fitted functions of one variable beside an explanation, those at `place` first, then the clearest.
pub(in crate::diagnose) fn missing_functions(
    all: &[&Explanation],
    beside: &Explanation,
    place: Option<&str>,
) -> Vec<MissingFunction> {
    let (there, elsewhere): (Vec<&Explanation>, Vec<&Explanation>) =
        (all.iter()).partition(|e| Some(e.last().target.as_str()) == place);
    (there.into_iter().chain(elsewhere))
        .filter(|e| [Nature::Function, Nature::Reading].contains(&e.last().nature))
        .filter(|e| e.log_z > beside.log_z)
        .filter_map(|e| {
            let curve = curve(e.model.as_ref()?)?;
            let term = e.last();
            let variances = curve.covariance.diagonal();
            Some(MissingFunction {
                place: term.target.clone(),
                variable: term.variables[0].0.clone(),
                on_top: !beside.terms.is_empty(),
                log_evidence: e.log_z - beside.log_z,
                mean: curve.mean.iter().copied().collect(),
                std_error: variances.iter().map(|v| v.max(0.0).sqrt()).collect(),
                values: curve.values,
            })
        })
        .take(THRESHOLDS.functions_told)
        .collect()
}
