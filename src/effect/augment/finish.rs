//! Rounding of finished outputs, and their outliers, which are drawn over the whole record.

use super::Slot;
use crate::effect::law::Law;
use crate::record::Signal;
use crate::twin::Noise;

/// Rounds the channel of an effect, or adds its outliers; does nothing for another law.
pub(super) fn finish(slot: &Slot, theta: &[f64], noise: Noise, outputs: &mut Signal) {
    let (m, channel) = (slot.place.m(theta), slot.place.target);
    match slot.effect.law() {
        Law::Rounding(law) => {
            let step = law(m);
            if step > 0.0 {
                (outputs.column_mut(channel))
                    .mapv_inplace(|value| step * (value / step + 0.5).floor());
            }
        }
        Law::Outliers(law) => {
            let hits = law(m);
            let mut source = noise.source(&slot.effect.key().to_string());
            for value in outputs.column_mut(channel) {
                // Both draws always, so that other magnitudes see the same draws.
                let (hit, size) = (source.happens(hits.probability), source.normal());
                *value += if hit { hits.scale * size } else { 0.0 };
            }
        }
        _ => {}
    }
}
