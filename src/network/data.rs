//! Training data: samples in parts, the blocks of an epoch, and the seeds that order them.

use super::NetworkError;
use crate::setting::number;
use crate::twin::mix;
use ndarray::{Array2, Axis};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::borrow::Cow;
use std::error::Error;

/// Most bytes of a block of several parts; one part is never divided.
const BLOCK: usize = 64 << 20;

/// Features (rows × n) and targets (rows × d) of one part.
pub type SamplePart<'a> = (Cow<'a, Array2<f64>>, Cow<'a, Array2<f64>>);

/// Reads a part of samples.
pub type ReadSamples<'a> =
    dyn Fn(usize) -> Result<SamplePart<'a>, Box<dyn Error + Send + Sync>> + 'a;

/// Rows of features and targets, both standardised, that need not fit into memory at once: they come in parts.
///
/// Rows are independent of each other and alike, so that any parts are a sample of the whole.
pub struct Samples<'a> {
    /// Features of a row, n.
    pub features: usize,
    /// Targets of a row, d.
    pub targets: usize,
    /// Rows of each part, in order.
    pub parts: Vec<usize>,
    /// Reads part number i; it is asked for once an epoch.
    pub read: Box<ReadSamples<'a>>,
}

debug_by_name!(Samples<'_>);

impl<'a> Samples<'a> {
    /// Samples in memory: one part.
    pub fn in_memory(features: &'a Array2<f64>, targets: &'a Array2<f64>) -> Self {
        Self {
            features: features.ncols(),
            targets: targets.ncols(),
            parts: vec![features.nrows()],
            read: Box::new(move |_| Ok((Cow::Borrowed(features), Cow::Borrowed(targets)))),
        }
    }
}

/// Use of a number drawn from the seed of a training; each has draws of its own.
#[derive(Clone, Copy)]
pub(super) enum SeedUse {
    Weights,
    Split,
    Shuffle,
    Dropout,
}

/// Derives a seed for `purpose` and `counter`, which may be the epoch or the step.
pub(super) fn derive(seed: u64, purpose: SeedUse, counter: u64) -> u64 {
    // The seed is mixed, too, lest neighbouring seeds meet at neighbouring counters.
    mix(mix(mix(seed) ^ purpose as u64) ^ counter)
}

/// The error of data without `what`, of which `least` are needed.
pub(super) fn missing(what: &str, least: usize) -> NetworkError {
    NetworkError::Data(format!("no {what}; at least {least} needed"))
}

/// Converts a matrix to 32 bits, each row filled up with zeros to `width`; refuses what is not finite.
pub(super) fn padded(
    what: &'static str,
    matrix: &Array2<f64>,
    width: usize,
) -> Result<Array2<f32>, NetworkError> {
    let mut rows = Array2::zeros((matrix.nrows(), width));
    for (row, (mut to, from)) in rows.rows_mut().into_iter().zip(matrix.rows()).enumerate() {
        for (column, (to, &value)) in to.iter_mut().zip(from).enumerate() {
            *to = value as f32;
            if !to.is_finite() {
                let value = number(value);
                return Err(NetworkError::Data(format!(
                    "{what}, row {row}, column {column}: {value} is not a finite 32-bit number"
                )));
            }
        }
    }
    Ok(rows)
}

/// The rows with these indices, one after another.
pub(super) fn gathered(rows: &Array2<f32>, indices: &[usize]) -> Vec<f32> {
    let mut all = Vec::with_capacity(indices.len() * rows.ncols());
    indices.iter().for_each(|&i| all.extend(rows.row(i)));
    all
}

/// Samples to learn from: one row of features and one of targets each.
#[derive(Debug, Clone)]
pub(super) struct Data {
    pub features: Array2<f32>,
    pub targets: Array2<f32>,
}

/// Reads a part.
pub(super) type Read<'a> = dyn Fn(usize) -> Result<Data, NetworkError> + 'a;

/// The rows of a training.
///
/// Where all parts together fit into a block they are read once: rows are held out at random, and each epoch has all other
/// rows in an order of its own. Otherwise the last parts are held out, and each epoch puts the other parts in an order of its
/// own, reads as many at a time as fit into a block, and orders the rows within.
pub(super) struct Feed<'a> {
    read: &'a Read<'a>,
    seed: u64,
    /// Rows of each part.
    sizes: Vec<usize>,
    /// Most rows of a block.
    most: usize,
    /// Parts before this one are trained on, the others are held out; all are trained on in memory.
    training: usize,
    memory: Option<InMemory>,
}

/// All parts, read once.
struct InMemory {
    data: Data,
    training: Vec<usize>,
    held_out: Data,
}

impl<'a> Feed<'a> {
    /// `sizes` are the rows of each part, `width` the 32-bit numbers of a row; about `share` of the rows is held out.
    pub fn new(
        sizes: &[usize],
        width: usize,
        read: &'a Read<'a>,
        share: f64,
        seed: u64,
    ) -> Result<Self, NetworkError> {
        Self::with_block(sizes, BLOCK / (size_of::<f32>() * width), read, share, seed)
    }

    /// With at most `most` rows in a block.
    pub fn with_block(
        sizes: &[usize],
        most: usize,
        read: &'a Read<'a>,
        share: f64,
        seed: u64,
    ) -> Result<Self, NetworkError> {
        let count: usize = sizes.iter().sum();
        let mut feed = Self {
            read,
            seed,
            sizes: sizes.to_vec(),
            most,
            training: sizes.len(),
            memory: None,
        };
        if sizes.len() < 2 || count <= most {
            let data = feed.parts(0..sizes.len())?;
            let (training, held_out) = split(count, share, seed)?;
            feed.memory = Some(InMemory {
                held_out: Data {
                    features: data.features.select(Axis(0), &held_out),
                    targets: data.targets.select(Axis(0), &held_out),
                },
                data,
                training,
            });
            return Ok(feed);
        }
        let mut held_out = 0;
        while feed.training > 1 && (held_out as f64) < share * count as f64 {
            feed.training -= 1;
            held_out += sizes[feed.training];
        }
        Ok(feed)
    }

    /// Rows that are trained on.
    pub fn rows(&self) -> usize {
        match &self.memory {
            Some(memory) => memory.training.len(),
            None => self.sizes[..self.training].iter().sum(),
        }
    }

    /// The parts of each block of an epoch.
    pub fn blocks(&self, epoch: usize) -> Vec<Vec<usize>> {
        if self.memory.is_some() {
            return vec![vec![]];
        }
        let mut parts: Vec<usize> = (0..self.training).collect();
        parts.shuffle(&mut self.order(epoch, 0));
        grouped(&parts, &self.sizes, self.most)
    }

    /// Block number `block` of an epoch, which has these parts: rows in memory, and the order in which they are used.
    pub fn block(
        &self,
        parts: &[usize],
        block: usize,
        epoch: usize,
    ) -> Result<(Cow<'_, Data>, Vec<usize>), NetworkError> {
        let (data, mut order, number) = match &self.memory {
            Some(memory) => (Cow::Borrowed(&memory.data), memory.training.clone(), 0),
            None => {
                let data = self.parts(parts.iter().copied())?;
                let order = (0..data.targets.nrows()).collect();
                (Cow::Owned(data), order, 1 + block)
            }
        };
        order.shuffle(&mut self.order(epoch, number));
        Ok((data, order))
    }

    /// The mean of `error` over the rows held out; `None` where there are none.
    pub fn held_out(
        &self,
        error: impl Fn(&Data) -> Result<f64, NetworkError>,
    ) -> Result<Option<f64>, NetworkError> {
        if let Some(InMemory { held_out, .. }) = &self.memory {
            let is_empty = held_out.targets.is_empty();
            return (!is_empty).then(|| error(held_out)).transpose();
        }
        let parts: Vec<usize> = (self.training..self.sizes.len()).collect();
        let (mut total, mut rows) = (0.0, 0.0);
        for block in grouped(&parts, &self.sizes, self.most) {
            let data = self.parts(block.into_iter())?;
            let here = data.targets.nrows() as f64;
            total += here * error(&data)?;
            rows += here;
        }
        Ok((rows > 0.0).then_some(total / rows))
    }

    /// These parts, one after another.
    fn parts(&self, parts: impl Iterator<Item = usize>) -> Result<Data, NetworkError> {
        let mut parts = parts.map(self.read).collect::<Result<Vec<Data>, _>>()?;
        if parts.len() == 1 {
            return Ok(parts.remove(0));
        }
        let stacked = |of: fn(&Data) -> &Array2<f32>| {
            let views: Vec<_> = parts.iter().map(|data| of(data).view()).collect();
            ndarray::concatenate(Axis(0), &views).map_err(|_| missing("samples", 1))
        };
        Ok(Data {
            features: stacked(|data| &data.features)?,
            targets: stacked(|data| &data.targets)?,
        })
    }

    /// The generator that orders the rows of a block, or (number 0) the parts or the only block of an epoch. An epoch depends
    /// on its number alone.
    fn order(&self, epoch: usize, number: usize) -> ChaCha8Rng {
        let epoch = derive(self.seed, SeedUse::Shuffle, epoch as u64);
        ChaCha8Rng::seed_from_u64(match number {
            0 => epoch,
            number => derive(epoch, SeedUse::Shuffle, number as u64),
        })
    }
}

/// Parts one after another, as many at a time as have at most `most` rows, but at least one.
fn grouped(parts: &[usize], sizes: &[usize], most: usize) -> Vec<Vec<usize>> {
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    let mut rows = 0;
    for &part in parts {
        match blocks.last_mut() {
            Some(block) if rows + sizes[part] <= most => block.push(part),
            _ => {
                blocks.push(vec![part]);
                rows = 0;
            }
        }
        rows += sizes[part];
    }
    blocks
}

/// Indices of the rows to train on and of those held out.
fn split(count: usize, share: f64, seed: u64) -> Result<(Vec<usize>, Vec<usize>), NetworkError> {
    let held_out = match (share * count as f64).round() as usize {
        0 if share > 0.0 => 1,
        held_out => held_out,
    };
    if held_out >= count {
        let least = 1 + usize::from(share > 0.0);
        return Err(missing("rows left to train on", least));
    }
    let mut training: Vec<usize> = (0..count).collect();
    let order = derive(seed, SeedUse::Split, 0);
    training.shuffle(&mut ChaCha8Rng::seed_from_u64(order));
    let held_out = training.split_off(count - held_out);
    // Each epoch orders them anew, from here.
    training.sort_unstable();
    Ok((training, held_out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use std::cell::RefCell;
    use std::collections::HashSet;

    #[test]
    fn the_split_is_a_partition_that_the_seed_decides() {
        let (training, held_out) = split(50, 0.2, 3).unwrap();
        assert_eq!((training.len(), held_out.len()), (40, 10));
        let all: HashSet<_> = training.iter().chain(&held_out).collect();
        assert_eq!(all.len(), 50);
        assert_eq!(split(50, 0.2, 3).unwrap().1, held_out);
        assert_ne!(split(50, 0.2, 4).unwrap().1, held_out);
        assert_eq!(
            split(3, 0.01, 0).unwrap().1.len(),
            1,
            "a share is never nothing"
        );
        assert!(split(1, 0.2, 0).is_err());
        assert!(split(0, 0.0, 0).is_err());
    }

    /// Part p has `sizes[p]` rows; each row's only feature is its number in the whole.
    fn part(sizes: &[usize], part: usize) -> Data {
        let first: usize = sizes[..part].iter().sum();
        let numbers: Vec<f32> = (first..first + sizes[part]).map(|i| i as f32).collect();
        let column = Array2::from_shape_vec((sizes[part], 1), numbers).unwrap();
        Data {
            features: column.clone(),
            targets: column,
        }
    }

    /// The rows of an epoch in the order of their use.
    fn epoch(feed: &Feed<'_>, epoch: usize) -> Vec<usize> {
        let mut all = Vec::new();
        for (number, parts) in feed.blocks(epoch).iter().enumerate() {
            let (data, order) = feed.block(parts, number, epoch).unwrap();
            let numbers = &data.features;
            all.extend(order.iter().map(|i| numbers[[*i, 0]] as usize));
        }
        all
    }

    #[test]
    fn every_epoch_has_every_row_once_in_an_order_of_its_own_whatever_the_blocks() {
        let sizes = [4, 4, 4, 4, 4, 3];
        let read = |index: usize| Ok(part(&sizes, index));
        for (most, in_memory) in [(100, true), (8, false), (3, false)] {
            let feed = Feed::with_block(&sizes, most, &read, 0.2, 1).unwrap();
            assert_eq!(feed.memory.is_some(), in_memory);
            let [first, second] = [0, 1].map(|e| epoch(&feed, e));
            assert_ne!(first, second);
            assert_eq!(
                first,
                epoch(&feed, 0),
                "an epoch depends on its number alone"
            );
            assert_eq!(first.len(), feed.rows());
            let held_out = RefCell::new(Vec::new());
            let mean = feed.held_out(|data| {
                let numbers = &data.features;
                held_out
                    .borrow_mut()
                    .extend(numbers.iter().map(|v| *v as usize));
                Ok(f64::from(numbers.sum()) / numbers.len() as f64)
            });
            let held_out = held_out.into_inner();
            let sum: usize = held_out.iter().sum();
            assert!((mean.unwrap().unwrap() - sum as f64 / held_out.len() as f64).abs() < 1e-9);
            for order in [first, second] {
                let all: HashSet<usize> = order.iter().chain(&held_out).copied().collect();
                assert_eq!((all.len(), order.len() + held_out.len()), (23, 23));
            }
            assert!((5..=7).contains(&held_out.len()), "{held_out:?}");
        }
    }

    #[test]
    fn blocks_hold_as_many_parts_as_fit_and_no_part_is_divided() {
        let sizes = [4, 4, 9, 1, 1];
        assert_eq!(
            grouped(&[0, 1, 2, 3, 4], &sizes, 8),
            [vec![0, 1], vec![2], vec![3, 4]]
        );
        let read = |_| unreachable!();
        let feed = Feed::with_block(&sizes, 8, &read, 0.0, 1).unwrap();
        assert_eq!(feed.rows(), 19);
        assert_eq!(feed.held_out(|_| Ok(1.0)).unwrap(), None);
    }

    #[test]
    fn rows_are_padded_and_what_is_not_finite_in_32_bits_is_named() {
        let rows = padded("features", &array![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], 3).unwrap();
        assert_eq!(gathered(&rows, &[2, 0]), [5.0, 6.0, 0.0, 1.0, 2.0, 0.0]);
        let error = padded("targets", &array![[1.0, 1e300]], 2).unwrap_err();
        let said = error.to_string();
        assert!(said.starts_with("targets, row 0, column 1: 1"), "{said}");
    }
}
