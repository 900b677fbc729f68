//! A trunk and its heads on a device.

use super::rows::Rows;
use super::{
    Batch, FirstWeight, HeadArchitecture, Layers, NamedTensor, NetworkError, TapedBatch, tensors,
};
use dfdx::prelude::{
    BuildOnDevice, Const, ConstDim, Cpu, HasShape, NoneTape, OwnedTape, TensorFromVec, Trace,
};
use std::collections::BTreeMap;
use std::marker::PhantomData;

/// Rows that are evaluated at a time: enough for fast products, few enough to stay in the cache.
const CHUNK: usize = 256;

/// Layers from `I` features to `K` hidden values, and one head for each output. With the trunk `()`, heads alone.
pub(super) struct Model<I, K, T, H> {
    pub(super) trunk: T,
    pub(super) heads: Vec<H>,
    widths: PhantomData<fn(I) -> K>,
}

/// The model of an architecture.
pub(super) type ModelOf<A> = Model<
    <A as HeadArchitecture>::Features,
    <A as HeadArchitecture>::Hidden,
    <<A as HeadArchitecture>::Trunk as BuildOnDevice<Cpu, f32>>::Built,
    <<A as HeadArchitecture>::Head as BuildOnDevice<Cpu, f32>>::Built,
>;

impl<I, K, T: Clone, H: Clone> Clone for Model<I, K, T, H> {
    fn clone(&self) -> Self {
        Self::new(self.trunk.clone(), self.heads.clone())
    }
}

impl<I, K, T, H> Model<I, K, T, H> {
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
    tensors::widen_first_layer(&mut trunk, inputs, A::Features::SIZE);
    tensors::set_dropout(&mut trunk, A::DROPOUT);
    let mut heads = Vec::with_capacity(outputs);
    for _ in 0..outputs {
        let mut head = A::Head::try_build_on_device(&device)?;
        tensors::set_dropout(&mut head, A::DROPOUT);
        heads.push(head);
    }
    Ok(Model::new(trunk, heads))
}

impl<I, K, T, H> Model<I, K, T, H>
where
    I: ConstDim,
    K: ConstDim,
    T: Layers<I, K>,
    H: Layers<K, Const<1>> + FirstWeight<K>,
{
    /// One taped prediction for each head. Dropout draws from `device`, which every operation passes on.
    pub(super) fn forward_taped(
        &mut self,
        features: Vec<f32>,
        device: &Cpu,
    ) -> Result<Vec<TapedBatch<Const<1>>>, NetworkError> {
        let rows = features.len() / I::SIZE;
        let x: Batch<I> = device.try_tensor_from_vec(features, (rows, I::default()))?;
        let hidden = self.trunk.try_forward_mut(x.leaky_traced())?;
        let bare: Batch<K> = hidden.retaped::<NoneTape>();
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
    pub(super) fn hidden(&self, features: &Rows) -> Result<Rows, NetworkError> {
        let mut hidden = Vec::with_capacity(features.len() * K::SIZE);
        self.each_chunk(features, |chunk| {
            hidden.extend(chunk.as_vec());
            Ok(())
        })?;
        Ok(Rows::new(K::SIZE, hidden))
    }

    /// The heads' outputs.
    pub(super) fn predict(&self, features: &Rows) -> Result<Rows, NetworkError> {
        let outputs = self.heads.len();
        let mut predictions = Vec::with_capacity(features.len() * outputs);
        self.each_chunk(features, |chunk| {
            let start = predictions.len();
            predictions.resize(start + chunk.shape().0 * outputs, 0.0);
            for (j, head) in self.heads.iter().enumerate() {
                let places = predictions[start + j..].iter_mut().step_by(outputs);
                for (place, value) in places.zip(head.try_forward(chunk.clone())?.as_vec()) {
                    *place = value;
                }
            }
            Ok(())
        })?;
        Ok(Rows::new(outputs, predictions))
    }

    fn each_chunk(
        &self,
        features: &Rows,
        mut take: impl FnMut(Batch<K>) -> Result<(), NetworkError>,
    ) -> Result<(), NetworkError> {
        let device = Cpu::default();
        for chunk in features.chunks(CHUNK) {
            let shape = (chunk.len() / I::SIZE, I::default());
            let x: Batch<I> = device.try_tensor_from_vec(chunk.to_vec(), shape)?;
            take(self.trunk.try_forward(x)?)?;
        }
        Ok(())
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
        let surplus = |tensor: &NamedTensor| NetworkError::SurplusTensor {
            name: tensor.name.clone(),
            found: tensor.shape.clone(),
            architecture,
        };
        let mut stored = BTreeMap::new();
        for tensor in weights {
            if stored.insert(tensor.name.as_str(), tensor).is_some() {
                return Err(surplus(tensor));
            }
        }
        tensors::assign(&mut self.trunk, "trunk", architecture, &mut stored)?;
        for (j, head) in self.heads.iter_mut().enumerate() {
            tensors::assign(head, &format!("heads.{j}"), architecture, &mut stored)?;
        }
        stored
            .values()
            .next()
            .map_or(Ok(()), |tensor| Err(surplus(tensor)))
    }
}
