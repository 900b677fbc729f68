//! placeholder while the real one is written
use crate::{study::Study, twin::*, two_stage::*};
/// x
pub fn estimate_json(_: &Study, e: &Estimate) -> serde_json::Value {
    serde_json::json!({"initial":e.initial,"gn":e.gauss_newton,"fine":e.fine,"theta":e.theta,"std":e.std_error,"p":e.gate.p_value,"after":e.after.map(|a|a.p_value),"rmse":e.tracking.rmse,"val":e.validation.as_ref().map(|v|v.rmse),"names":e.names, "sims": e.simulations, "gn_s": e.seconds.gauss_newton, "tune_s": e.seconds.tune, "total":e.seconds.total})
}
/// x
pub fn estimate_text(s: &Study, e: &Estimate) -> String {
    estimate_json(s, e).to_string()
}
/// x
pub fn overlay_svg(_: &Study, _: &Record, _: Option<&Signal>, _: &Signal) -> String {
    String::new()
}
/// x
pub fn trajectories_csv(_: &Record, _: Option<&Signal>, _: &Signal) -> String {
    String::new()
}
