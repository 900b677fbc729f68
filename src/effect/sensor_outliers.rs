//! A sensor that is now and then wrong.

use crate::effect::{Given, Law, Magnitude, UnmodelledEffect};
use crate::twin::{Outliers, Source};
use serde::{Deserialize, Serialize};

/// Rare large errors after everything else: with the probability, N(0, scale²) is added to a sample.
///
/// Magnitudes: `probability` a sample, in [0, 1], off at 0; the shape `scale` in the unit of the signal, 0 or more.
///
/// ```
/// use truetwin::effect::SensorOutliers;
/// use truetwin::effect::{Given, UnmodelledEffect};
///
/// let effect = SensorOutliers { target: "sensor".into(), magnitudes: Given::default() };
/// let hits = effect.outliers(&[0.05, 2.0]).ok_or("they are said for filters")?;
/// assert_eq!((hits.probability, hits.scale), (0.05, 2.0));
/// # Ok::<(), &str>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorOutliers {
    /// `sensor`, or `sensor1`… where there are several.
    pub target: String,
    /// Magnitudes held at a value; the others are free.
    #[serde(default)]
    pub magnitudes: Given,
}

#[typetag::serde(name = "sensor-outliers")]
impl UnmodelledEffect for SensorOutliers {
    accessors!();

    fn magnitudes(&self) -> Vec<Magnitude> {
        vec![
            Magnitude::positive("probability", "1", &[0.01, 0.05]).within(0.0, 1.0),
            Magnitude::positive("scale", "signal", &[0.5, 2.0]).shape(),
        ]
    }

    fn law(&self) -> Law {
        Law::Outliers
    }

    fn order(&self) -> u32 {
        100
    }

    fn outliers(&self, m: &[f64]) -> Option<Outliers> {
        Some(Outliers {
            probability: m[0],
            scale: m[1],
        })
    }

    fn outlier(&self, m: &[f64], source: &mut Source) -> f64 {
        // Both draws always, so that other magnitudes see the same draws.
        let (hit, size) = (source.happens(m[0]), source.normal());
        if hit { m[1] * size } else { 0.0 }
    }
}
