//! Matrices of 32-bit numbers, one sample a row, padded to a layer's width.

use super::NetworkError;
use ndarray::Array2;

/// Row-major numbers, `width` to a row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rows {
    width: usize,
    numbers: Vec<f32>,
}

impl Rows {
    /// `numbers`, a whole number of rows of `width` > 0.
    pub(super) fn new(width: usize, numbers: Vec<f32>) -> Self {
        debug_assert!(numbers.len().is_multiple_of(width));
        Self { width, numbers }
    }

    /// Copies `matrix`, each row filled up with zeros to `width`; refuses what is not finite.
    pub(super) fn padded(
        what: &'static str,
        matrix: &Array2<f64>,
        width: usize,
    ) -> Result<Self, NetworkError> {
        let mut numbers = vec![0.0; matrix.nrows() * width];
        for (row, (to, from)) in numbers
            .chunks_exact_mut(width)
            .zip(matrix.rows())
            .enumerate()
        {
            for (column, (to, from)) in to.iter_mut().zip(from).enumerate() {
                *to = *from as f32;
                if !to.is_finite() {
                    return Err(NetworkError::NotFinite {
                        what,
                        row,
                        column,
                        value: *from,
                    });
                }
            }
        }
        Ok(Self { width, numbers })
    }

    /// Adds the rows of another matrix of the same width.
    pub(super) fn append(&mut self, other: Self) {
        debug_assert_eq!(self.width, other.width);
        self.numbers.extend(other.numbers);
    }

    pub(super) fn len(&self) -> usize {
        self.numbers.len() / self.width
    }

    /// The rows with these indices, one after another.
    pub(super) fn gather(&self, indices: &[usize]) -> Vec<f32> {
        let mut gathered = Vec::with_capacity(indices.len() * self.width);
        for &i in indices {
            gathered.extend_from_slice(&self.numbers[i * self.width..(i + 1) * self.width]);
        }
        gathered
    }

    /// The matrix of the rows with these indices.
    pub(super) fn select(&self, indices: &[usize]) -> Self {
        Self::new(self.width, self.gather(indices))
    }

    /// All numbers, row-major.
    pub(super) fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// At most `count` rows at a time, in order.
    pub(super) fn chunks(&self, count: usize) -> impl Iterator<Item = &[f32]> {
        self.numbers.chunks(count * self.width)
    }

    pub(super) fn to_matrix(&self) -> Array2<f64> {
        Array2::from_shape_fn((self.len(), self.width), |(i, j)| {
            f64::from(self.numbers[i * self.width + j])
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn rows_are_padded_gathered_and_returned() {
        let rows =
            Rows::padded("features", &array![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], 3).unwrap();
        assert_eq!(rows.gather(&[2, 0]), [5.0, 6.0, 0.0, 1.0, 2.0, 0.0]);
        assert_eq!(rows.chunks(2).map(<[f32]>::len).collect::<Vec<_>>(), [6, 3]);
        assert_eq!(rows.to_matrix().row(1), array![3.0, 4.0, 0.0]);
    }

    #[test]
    fn what_is_not_finite_in_32_bits_is_named() {
        let error = Rows::padded("targets", &array![[1.0, 1e300]], 2).unwrap_err();
        let said = error.to_string();
        assert!(said.starts_with("targets, row 0, column 1: 1"), "{said}");
    }
}
