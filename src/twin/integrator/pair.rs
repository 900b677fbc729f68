//! The explicit pair of orders 5 and 4 of Dormand and Prince (1980), as in Hairer, Nørsett, Wanner, *Solving Ordinary Differential
//! Equations I*, table II.5.2.

use super::path::{Path, Stretch};

const NODES: [f64; 7] = [0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0];
/// Weights of earlier slopes at each stage; the last are those of the step.
const STAGES: [&[f64]; 7] = [
    &[],
    &[0.2],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
    ],
    &[
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
    ],
    &[
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
];
/// Weights of the difference to the step of order 4.
const DIFFERENCE: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];
/// Product of step and rate of decay near that beyond which errors of explicit steps grow (3.3): steps that stability limits are around it,
/// those that a tolerance limits are far below.
pub(super) const STABLE: f64 = 2.5;
/// Order of the error that is estimated.
pub(super) const ORDER: f64 = 5.0;

/// Buffers of the pair.
#[derive(Debug, Clone, Default)]
pub(super) struct ExplicitPair {
    slopes: [Vec<f64>; 7],
    stage: Vec<f64>,
    /// State at which the slope before the last is taken, and the length of the last step times the largest rate that its end shows.
    sixth: Vec<f64>,
    reach: f64,
}

impl ExplicitPair {
    /// Carries points over a stretch; `errors` are the differences between both orders.
    pub fn step(
        &mut self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        x: &mut [f64],
        errors: Option<&mut [f64]>,
    ) {
        let (h, size) = (path.seconds(of), x.len());
        self.stage.resize(size, 0.0);
        path.begin_step();
        // The slope at the end serves the errors alone.
        let stages = if errors.is_some() { 7 } else { 6 };
        for i in 0..stages {
            self.shifted(h, STAGES[i], x);
            self.slopes[i].resize(size, 0.0);
            path.rates(of, NODES[i], &self.stage, &mut self.slopes[i]);
            if i == 5 && stages == 7 {
                self.sixth.clone_from(&self.stage);
            }
        }
        if let Some(errors) = errors {
            errors.fill(0.0);
            for (weight, slope) in DIFFERENCE.iter().zip(&self.slopes) {
                for (error, slope) in errors.iter_mut().zip(slope) {
                    *error += h * weight * slope;
                }
            }
        }
        if stages == 7 {
            self.reach =
                h * distance(&self.slopes[6], &self.slopes[5]) / distance(&self.stage, &self.sixth);
        }
        self.shifted(h, STAGES[6], x);
        x.copy_from_slice(&self.stage);
    }

    /// Sets `errors` to those of a step in which the states stand at `x`: of what changes with time alone.
    pub fn errors_at_rest(
        &mut self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        x: &[f64],
        errors: &mut [f64],
    ) {
        let h = path.seconds(of);
        let slope = &mut self.slopes[0];
        slope.resize(x.len(), 0.0);
        path.begin_step();
        errors.fill(0.0);
        for (node, weight) in NODES.into_iter().zip(DIFFERENCE) {
            path.rates(of, node, x, slope);
            for (error, slope) in errors.iter_mut().zip(&*slope) {
                *error += h * weight * slope;
            }
        }
    }

    /// Length of the last step with errors, times the largest rate of decay that is seen at its end (Hairer and Wanner, *Solving Ordinary
    /// Differential Equations II*, section IV.2): around [`STABLE`] where stability limits the step.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Sets the stage to `x` and weighted slopes.
    fn shifted(&mut self, h: f64, weights: &[f64], x: &[f64]) {
        self.stage.copy_from_slice(x);
        for (weight, slope) in weights.iter().zip(&self.slopes) {
            if *weight != 0.0 {
                for (stage, slope) in self.stage.iter_mut().zip(slope) {
                    *stage += h * weight * slope;
                }
            }
        }
    }
}

/// Distance of two states.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}
