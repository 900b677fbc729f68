//! Architectures that are ready for use, named after their structure.

use super::layers::*;

/// A shallow network for few features: the one that Van der Pol uses.
///
/// Up to 16 features; trunk 256, 128 with ReLU; heads of two layers of 128 with tanh; dropout 0.1.
///
/// ```
/// use ndarray::{Array2, array};
/// use truetwin::network::{Compact, Training, architecture};
/// use truetwin::progress::Progress;
///
/// let features = Array2::from_shape_fn((64, 2), |(i, j)| ((i * 7 + j * 5) % 16) as f64 / 8.0 - 1.0);
/// let targets = features.dot(&array![[1.0], [-0.5]]);
/// let quick = Training { epochs: 3, ..Training::default() };
///
/// let (network, _) = architecture::<Compact>().train(&features, &targets, &quick, 1, &Progress::silent())?;
/// assert_eq!((network.inputs(), network.outputs()), (2, 1));
/// # Ok::<(), truetwin::network::NetworkError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Compact;

impl HeadArchitecture for Compact {
    const ID: &'static str = "compact";
    type Features = Const<16>;
    type Hidden = Const<128>;
    type Trunk = (Dense<16, 256, ReLU>, Dense<256, 128, ReLU>);
    type Head = (Dense<128, 128, Tanh>, Dense<128, 128, Tanh>, Linear<128, 1>);
    const DROPOUT: f64 = 0.1;
}

/// A deeper, normalised network for many features: the one that the cascaded tanks use.
///
/// Up to 128 features; trunk 256, 256 with layer normalisation and leaky ReLU; heads of three layers of 64 with layer
/// normalisation and tanh; dropout 0.15.
///
/// ```
/// use truetwin::network::{Deep, architecture};
///
/// assert_eq!(architecture::<Deep>().max_features(), 128);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Deep;

impl HeadArchitecture for Deep {
    const ID: &'static str = "deep";
    type Features = Const<128>;
    type Hidden = Const<256>;
    type Trunk = (NormDense<128, 256, Leaky>, NormDense<256, 256, Leaky>);
    type Head = (
        NormDense<256, 64, Tanh>,
        NormDense<64, 64, Tanh>,
        NormDense<64, 64, Tanh>,
        Linear<64, 1>,
    );
    const DROPOUT: f64 = 0.15;
}
