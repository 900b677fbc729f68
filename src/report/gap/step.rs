//! The finer step that a diagnosis was made with, as a user would set it.

use crate::diagnose::Diagnosis;
use crate::twin::Integrator;

/// The settings of a study for the finer step that the diagnosis used; none where it used the twin's own.
pub(super) fn step_setting(diagnosis: &Diagnosis) -> Option<String> {
    let (integrator, substeps) = (diagnosis.integrator?, diagnosis.substeps?);
    let mut settings = vec![];
    if integrator == Integrator::RungeKutta4 {
        settings.push("integrator = \"runge-kutta-4\"".to_owned());
    }
    if substeps > 1 || settings.is_empty() {
        settings.push(format!("substeps = {substeps}"));
    }
    Some(format!("[record] {}", settings.join(", ")))
}
