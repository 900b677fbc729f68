//! States whose rate another state is by definition.

use super::{Now, StateSpace};

/// Points at which equations are compared: a definition holds at any.
const POINTS: usize = 4;

/// Returns for each state whether its rate is another state, whatever θ, inputs and time: a position, whose rate its velocity is called.
/// No law can be missing there.
pub(super) fn defined_states(twin: &dyn StateSpace) -> Vec<bool> {
    let outline = twin.outline();
    let n = outline.states.len();
    let mut same = vec![vec![true; n]; n];
    for point in 0..POINTS {
        // Values of either sign, no two alike.
        let value = |i: usize| {
            let turn = (1 + i + 13 * point) as f64 * std::f64::consts::E;
            (0.3 + turn.fract())
                * if (i + point).is_multiple_of(2) {
                    1.0
                } else {
                    -1.0
                }
        };
        let x: Vec<f64> = (0..n).map(value).collect();
        let u: Vec<f64> = (0..outline.inputs.len()).map(|j| value(n + j)).collect();
        let share = value(2 * n).abs().fract();
        let theta: Vec<f64> = (outline.parameters.iter())
            .map(|p| p.bounds.clamp(p.prior.low() + share * p.prior.width()))
            .collect();
        let mut rate = vec![0.0; n];
        twin.drift(&Now::new(point as f64, 0.1, &u, &theta), &x, &mut rate);
        for i in 0..n {
            for j in 0..n {
                same[i][j] &= i != j && rate[i] == x[j];
            }
        }
    }
    same.iter().map(|row| row.contains(&true)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twins::{CascadedTanks, VanDerPol};

    #[test]
    fn a_position_is_defined_by_its_velocity_and_a_level_is_not() {
        assert_eq!(defined_states(&VanDerPol), [true, false]);
        assert_eq!(defined_states(&CascadedTanks), [false, false]);
    }
}
