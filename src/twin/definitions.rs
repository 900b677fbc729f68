//! States whose rate another state is by definition.

use super::{Composed, Noise, Now};

/// Points at which equations are compared: a definition holds at any.
const POINTS: u64 = 5;

/// Finds pairs (rate, of): the rate of the second state is the first one at every one of a few random points, as of a
/// position and its velocity.
pub(crate) fn rates(twin: &Composed) -> Vec<(usize, usize)> {
    let (outline, limits) = (twin.outline(), twin.limits());
    let n = outline.states.len();
    let mut pairs: Vec<(usize, usize)> = (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .filter(|(i, j)| i != j)
        .collect();
    for point in 0..POINTS {
        let mut source = Noise::new(0, "rates", point).source("point");
        let x: Vec<f64> = (limits.iter())
            .map(|limit| match (limit.low(), limit.high()) {
                (low, high) if limit.is_finite() => low + source.uniform() * (high - low),
                (low, _) if low.is_finite() => low + source.normal().abs(),
                (_, high) if high.is_finite() => high - source.normal().abs(),
                _ => source.normal(),
            })
            .collect();
        let u: Vec<f64> = outline.inputs.iter().map(|_| source.uniform()).collect();
        let theta = outline.parameters.draw_prior(Noise::new(0, "rates", point));
        let mut dx = vec![0.0; x.len()];
        twin.drift(&Now::new(0.0, 1.0, &u, &theta), &x, &mut dx);
        pairs.retain(|&(i, j)| dx[j] == x[i]);
    }
    pairs
}

/// Returns for each state whether its rate is another state, whatever θ, inputs and time: no law can be missing there.
pub(super) fn defined_states(twin: &Composed) -> Vec<bool> {
    let mut defined = vec![false; twin.outline().states.len()];
    for (_, of) in rates(twin) {
        defined[of] = true;
    }
    defined
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twins::{CascadedTanks, VanDerPol};

    #[test]
    fn a_position_is_defined_by_its_velocity_and_a_level_is_not() {
        assert_eq!(defined_states(&VanDerPol.into()), [true, false]);
        assert_eq!(defined_states(&CascadedTanks.into()), [false, false]);
    }
}
