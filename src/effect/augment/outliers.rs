//! Outliers: random, after everything else along the signal, so drawn over the finished record.

use super::Slot;
use crate::effect::law::Law;
use crate::record::Signal;
use crate::twin::Noise;

/// Adds the outliers of an effect to its channel; does nothing for another law.
pub(super) fn strike(slot: &Slot, theta: &[f64], noise: Noise, outputs: &mut Signal) {
    let Law::Outliers(law) = slot.effect.law() else {
        return;
    };
    let hits = law(slot.place.m(theta));
    let mut source = noise.source(&slot.effect.key().to_string());
    for value in outputs.column_mut(slot.place.target) {
        // Both draws always, so that other magnitudes see the same draws.
        let (hit, size) = (source.happens(hits.probability), source.normal());
        *value += if hit { hits.scale * size } else { 0.0 };
    }
}
