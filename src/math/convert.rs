//! Conversions between slices, vectors and matrices of nalgebra, and arrays of ndarray.

use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, ArrayRef1, ArrayRef2};

/// Returns the matrix with the entries of an array.
pub fn to_matrix(array: &ArrayRef2<f64>) -> DMatrix<f64> {
    DMatrix::from_row_iterator(array.nrows(), array.ncols(), array.iter().copied())
}

/// Returns the array with the entries of a matrix.
pub fn to_array(matrix: &DMatrix<f64>) -> Array2<f64> {
    Array2::from_shape_fn(matrix.shape(), |at| matrix[at])
}

/// Returns the vector with the entries of a row or a column of an array.
pub fn to_vector(line: &ArrayRef1<f64>) -> DVector<f64> {
    DVector::from_iterator(line.len(), line.iter().copied())
}

/// Returns the array of one row.
pub fn one_row(values: &[f64]) -> Array2<f64> {
    Array2::from_shape_fn((1, values.len()), |(_, j)| values[j])
}
