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
/// Order of the error that is estimated.
pub(super) const ORDER: f64 = 5.0;

/// Buffers of the pair.
#[derive(Debug, Clone, Default)]
pub(super) struct ExplicitPair {
    slopes: [Vec<f64>; 7],
    stage: Vec<f64>,
}

impl ExplicitPair {
    /// Carries points over a stretch; `error`, of the first point, is the difference between both orders.
    pub fn step(
        &mut self,
        path: &mut Path<'_, '_>,
        of: Stretch,
        x: &mut [f64],
        error: Option<&mut [f64]>,
    ) {
        let (h, size) = (path.seconds(of), x.len());
        self.stage.resize(size, 0.0);
        // The slope at the end serves the error alone.
        let stages = if error.is_some() { 7 } else { 6 };
        for i in 0..stages {
            self.shifted(h, STAGES[i], x);
            self.slopes[i].resize(size, 0.0);
            path.rates(of, NODES[i], &self.stage, &mut self.slopes[i]);
        }
        if let Some(error) = error {
            for (i, error) in error.iter_mut().enumerate() {
                let parts = DIFFERENCE.iter().zip(&self.slopes);
                *error = h * parts.map(|(weight, slope)| weight * slope[i]).sum::<f64>();
            }
        }
        self.shifted(h, STAGES[6], x);
        x.copy_from_slice(&self.stage);
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
