//! Bounds on the layers of an architecture.

use super::{Batch, TapedBatch};
use dfdx::prelude::{ConstDim, Cpu, CpuError, Module, ModuleMut, TensorCollection};

/// Layers on a device that map rows of width `I` to rows of width `O`, with and without a tape.
///
/// Implemented for all that qualifies: dfdx layers, fused layers and tuples of them.
pub trait Layers<I: ConstDim, O: ConstDim>:
    TensorCollection<f32, Cpu, To<f32, Cpu> = Self>
    + Clone
    + Send
    + Sync
    + Module<Batch<I>, Output = Batch<O>, Error = CpuError>
    + ModuleMut<TapedBatch<I>, Output = TapedBatch<O>, Error = CpuError>
    + 'static
{
}

impl<I: ConstDim, O: ConstDim, T> Layers<I, O> for T where
    T: TensorCollection<f32, Cpu, To<f32, Cpu> = T>
        + Clone
        + Send
        + Sync
        + Module<Batch<I>, Output = Batch<O>, Error = CpuError>
        + ModuleMut<TapedBatch<I>, Output = TapedBatch<O>, Error = CpuError>
        + 'static
{
}
