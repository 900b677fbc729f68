//! A trunk and its heads on a device.

use super::data::gathered;
use super::{
    BuiltDense, BuiltNormDense, HeadArchitecture, NamedTensor, NetworkError, PlainBatch,
    TapedBatch, tensors,
};
use dfdx::nn::modules::Linear;
use dfdx::prelude::{
    BuildOnDevice, Const, ConstDim, Cpu, CpuError, Module, ModuleMut, NoneTape, OwnedTape, Tensor,
    TensorCollection, TensorFromVec, Trace,
};
use ndarray::{Array2, ArrayViewMut2, Axis};
use std::collections::BTreeMap;
use std::marker::PhantomData;

/// Rows that are evaluated at a time: enough for fast products, few enough to stay in the cache.
const CHUNK: usize = 256;

/// Layers on a device that map rows of width `I` to rows of width `O`, with and without a tape.
///
/// Implemented for all that qualifies: dfdx layers, fused layers and tuples of them.
pub trait Layers<I: ConstDim, O: ConstDim>:
    TensorCollection<f32, Cpu, To<f32, Cpu> = Self>
    + Clone
    + Send
    + Sync
    + Module<PlainBatch<I>, Output = PlainBatch<O>, Error = CpuError>
    + ModuleMut<TapedBatch<I>, Output = TapedBatch<O>, Error = CpuError>
    + 'static
{
}

impl<I: ConstDim, O: ConstDim, T> Layers<I, O> for T where
    T: TensorCollection<f32, Cpu, To<f32, Cpu> = T>
        + Clone
        + Send
        + Sync
        + Module<PlainBatch<I>, Output = PlainBatch<O>, Error = CpuError>
        + ModuleMut<TapedBatch<I>, Output = TapedBatch<O>, Error = CpuError>
        + 'static
{
}

/// Layers whose first one multiplies rows of width `I` by a weight, which the orthogonality penalty compares between heads.
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

/// Layers from `I` features to `K` hidden values, and one head for each output. With the trunk `()`, heads alone.
pub(super) struct MultiHeadModel<I, K, T, H> {
    pub(super) trunk: T,
    pub(super) heads: Vec<H>,
    widths: PhantomData<fn(I) -> K>,
}

/// The model of an architecture.
pub(super) type ModelOf<A> = MultiHeadModel<
    <A as HeadArchitecture>::Features,
    <A as HeadArchitecture>::Hidden,
    <<A as HeadArchitecture>::Trunk as BuildOnDevice<Cpu, f32>>::Built,
    <<A as HeadArchitecture>::Head as BuildOnDevice<Cpu, f32>>::Built,
>;

impl<I, K, T: Clone, H: Clone> Clone for MultiHeadModel<I, K, T, H> {
    fn clone(&self) -> Self {
        Self::new(self.trunk.clone(), self.heads.clone())
    }
}

impl<I, K, T, H> MultiHeadModel<I, K, T, H> {
    pub(super) fn new(trunk: T, heads: Vec<H>) -> Self {
        Self {
            trunk,
            heads,
            widths: PhantomData,
        }
    }
}

/// Builds the model of `A` with initial weights that `seed` alone decides.
pub(super) fn build<A: HeadArchitecture>(
    inputs: usize,
    outputs: usize,
    seed: u64,
) -> Result<ModelOf<A>, NetworkError> {
    let device = Cpu::seed_from_u64(seed);
    let mut trunk = A::Trunk::try_build_on_device(&device)?;
    tensors::widen_first_layer(&mut trunk, inputs, A::Features::SIZE)?;
    tensors::set_dropout(&mut trunk, A::DROPOUT)?;
    let mut heads = Vec::with_capacity(outputs);
    for _ in 0..outputs {
        let mut head = A::Head::try_build_on_device(&device)?;
        tensors::set_dropout(&mut head, A::DROPOUT)?;
        heads.push(head);
    }
    Ok(MultiHeadModel::new(trunk, heads))
}

impl<I, K, T, H> MultiHeadModel<I, K, T, H>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    /// One taped prediction for each head, of the rows with these indices. Dropout draws from `device`, which every operation passes on.
    pub(super) fn forward_taped(
        &mut self,
        features: &Array2<f32>,
        batch: &[usize],
        device: &Cpu,
    ) -> Result<Vec<TapedBatch<Const<1>>>, NetworkError> {
        let shape = (batch.len(), I::default());
        let x: PlainBatch<I> = device.try_tensor_from_vec(gathered(features, batch), shape)?;
        let hidden = self.trunk.try_forward_mut(x.leaky_traced())?;
        let bare: PlainBatch<K> = hidden.retaped::<NoneTape>();
        let mut hidden = Some(hidden);
        self.heads
            .iter_mut()
            .map(|head| {
                // The first head carries the trunk's tape on; the others begin tapes of their own at the same tensor.
                let input = hidden
                    .take()
                    .unwrap_or_else(|| bare.retaped::<OwnedTape<f32, Cpu>>());
                Ok(head.try_forward_mut(input)?)
            })
            .collect()
    }

    /// The trunk's outputs.
    pub(super) fn hidden(&self, features: &Array2<f32>) -> Result<Array2<f32>, NetworkError> {
        self.evaluated(features, K::SIZE, |hidden, mut place| {
            let values = hidden.as_vec();
            place.iter_mut().zip(values).for_each(|(to, v)| *to = v);
            Ok(())
        })
    }

    /// The heads' outputs.
    pub(super) fn predict(&self, features: &Array2<f32>) -> Result<Array2<f32>, NetworkError> {
        self.evaluated(features, self.heads.len(), |hidden, mut place| {
            for (head, mut column) in self.heads.iter().zip(place.columns_mut()) {
                let values = head.try_forward(hidden.clone())?.as_vec();
                column.iter_mut().zip(values).for_each(|(to, v)| *to = v);
            }
            Ok(())
        })
    }

    /// Puts the features through the trunk; `fill` makes `width` numbers of each row of its outputs.
    fn evaluated(
        &self,
        features: &Array2<f32>,
        width: usize,
        fill: impl Fn(PlainBatch<K>, ArrayViewMut2<'_, f32>) -> Result<(), NetworkError>,
    ) -> Result<Array2<f32>, NetworkError> {
        let mut all = Array2::zeros((features.nrows(), width));
        let places = all.axis_chunks_iter_mut(Axis(0), CHUNK);
        for (rows, place) in features.axis_chunks_iter(Axis(0), CHUNK).zip(places) {
            let (shape, values) = ((rows.nrows(), I::default()), rows.iter().copied());
            let x: PlainBatch<I> = Cpu::default().try_tensor_from_vec(values.collect(), shape)?;
            fill(self.trunk.try_forward(x)?, place)?;
        }
        Ok(all)
    }

    pub(super) fn weights(&self) -> Vec<NamedTensor> {
        let mut weights = Vec::new();
        tensors::collect(&self.trunk, "trunk", &mut weights);
        for (j, head) in self.heads.iter().enumerate() {
            tensors::collect(head, &format!("heads.{j}"), &mut weights);
        }
        weights
    }

    /// Takes over `weights`, which must be exactly those of this model.
    pub(super) fn restore(
        &mut self,
        architecture: &'static str,
        weights: &[NamedTensor],
    ) -> Result<(), NetworkError> {
        let surplus = |tensor: &NamedTensor| {
            let problem = format!(
                "of shape {:?} has no place in `{architecture}`; was it stored by another architecture?",
                tensor.shape
            );
            Err(tensors::misfit(&tensor.name, &problem))
        };
        let mut stored = BTreeMap::new();
        for tensor in weights {
            if stored.insert(tensor.name.as_str(), tensor).is_some() {
                return surplus(tensor);
            }
        }
        tensors::assign(&mut self.trunk, "trunk", architecture, &mut stored)?;
        for (j, head) in self.heads.iter_mut().enumerate() {
            tensors::assign(head, &format!("heads.{j}"), architecture, &mut stored)?;
        }
        stored
            .values()
            .next()
            .map_or(Ok(()), |tensor| surplus(tensor))
    }
}
