//! Layers of one taped operation, and the loops that they are made of.

mod activation;
mod dense;
mod gemm;
pub(super) mod kernel;

pub use activation::Leaky;
pub(super) use dense::numbers;
pub(crate) use dense::{BuiltDense, BuiltNormDense};
pub use dense::{Dense, NormDense};
pub(super) use gemm::{Existing, Matrix, multiply};
