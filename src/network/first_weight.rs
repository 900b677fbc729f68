//! Reaches the first weight of a head, which the orthogonality penalty compares between heads.

use super::{BuiltDense, BuiltNormDense};
use dfdx::nn::modules::Linear;
use dfdx::prelude::{Const, ConstDim, Cpu, Tensor};

/// Layers whose first one multiplies rows of width `I` by a weight.
///
/// Implemented for dfdx's `Linear`, [`Dense`](super::Dense), [`NormDense`](super::NormDense), and tuples, nested too,
/// that begin with one of them.
pub trait FirstWeight<I: ConstDim> {
    /// Rows of the weight: outputs of the first layer.
    type Rows: ConstDim;

    /// The weight, rows × I.
    fn first_weight(&self) -> &Tensor<(Self::Rows, I), f32, Cpu>;
}

macro_rules! weight_of_layer {
    ($layer:ty $(, $activation:ident)?) => {
        impl<const I: usize, const O: usize $(, $activation)?> FirstWeight<Const<I>> for $layer {
            type Rows = Const<O>;

            fn first_weight(&self) -> &Tensor<(Const<O>, Const<I>), f32, Cpu> {
                &self.weight
            }
        }
    };
}
weight_of_layer!(Linear<I, O, f32, Cpu>);
weight_of_layer!(BuiltDense<I, O, A, f32, Cpu>, A);
weight_of_layer!(BuiltNormDense<I, O, A, f32, Cpu>, A);

macro_rules! weight_of_tuple {
    ($($rest:ident),*) => {
        impl<I: ConstDim, First: FirstWeight<I>, $($rest),*> FirstWeight<I> for (First, $($rest,)*) {
            type Rows = First::Rows;

            fn first_weight(&self) -> &Tensor<(Self::Rows, I), f32, Cpu> {
                self.0.first_weight()
            }
        }
    };
}
// As long as dfdx's own tuples.
weight_of_tuple!();
weight_of_tuple!(B);
weight_of_tuple!(B, C);
weight_of_tuple!(B, C, D);
weight_of_tuple!(B, C, D, E);
weight_of_tuple!(B, C, D, E, F);
