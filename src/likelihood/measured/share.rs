//! Noise that grows with the signal.

use crate::twin::{LevelValue, Parameter, Role, Twin, TwinPart};

/// Largest share of its signal that noise may be: what says less of its signal is no reading of it. Half of it leaves out counts of few
/// events; twice as much changes no answer.
pub(crate) const LARGEST_SHARE: f64 = 0.5;
/// Ending of the name of a share, behind that of its output.
const SUFFIX: &str = ".share";

/// Returns the twin with noise of an output that grows with its signal, θ longer by the share.
///
/// ```text
/// r_j = level + share·|y_j|
/// ```
pub(crate) fn with_share(twin: &Twin, output: usize) -> Twin {
    let name = share_name(&twin.signals().outputs[output].name);
    let share = Parameter::new(&Role::Noise.name(&name), "1", 0.0, 0.1)
        .within(0.0, LARGEST_SHARE)
        .with_role(Role::Noise);
    let part = TwinPart::Share {
        output,
        share: LevelValue::Parameter(twin.entries()),
    };
    twin.with([share], vec![part])
}

/// Returns the name of the share of an output's noise, `y.share`.
pub(crate) fn share_name(output: &str) -> String {
    format!("{output}{SUFFIX}")
}
