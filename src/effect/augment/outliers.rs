//! Outliers: random, after everything else along the signal, so drawn over the finished record.

use super::Slot;
use crate::record::Signal;
use crate::twin::Noise;

/// Adds the outliers of one effect to its channel.
pub(super) fn strike(slot: &Slot, theta: &[f64], noise: Noise, outputs: &mut Signal) {
    let mut source = noise.source(&format!(
        "{}@{}",
        slot.effect.typetag_name(),
        slot.effect.target()
    ));
    for value in outputs.column_mut(slot.target) {
        *value += slot.effect.outlier(slot.m(theta), &mut source);
    }
}
