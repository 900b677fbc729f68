//! Architectures that are ready for use, named after their structure.

use super::layers::*;

/// A shallow network for few features: the one that Van der Pol uses.
///
/// Up to 16 features; trunk 256, 128 with ReLU; heads of two layers of 128 with tanh; dropout 0.1.
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
