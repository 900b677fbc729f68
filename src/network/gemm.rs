//! The one door to matrix multiplication: checked views in, one `unsafe` call behind.

/// A read-only matrix over a slice, with strides, so that blocks and transposes need no copy.
#[derive(Clone, Copy)]
pub(super) struct Matrix<'a> {
    data: &'a [f32],
    rows: usize,
    cols: usize,
    row_stride: usize,
    col_stride: usize,
}

impl<'a> Matrix<'a> {
    /// Row-major `rows` × `cols`, its rows `row_stride` ≥ `cols` apart. Panics where `data` is too short: a bug here.
    pub(super) fn new(data: &'a [f32], rows: usize, cols: usize, row_stride: usize) -> Self {
        assert!(rows > 0 && cols > 0 && row_stride >= cols);
        assert!(data.len() >= (rows - 1) * row_stride + cols);
        Self {
            data,
            rows,
            cols,
            row_stride,
            col_stride: 1,
        }
    }

    /// The same numbers, rows and columns exchanged.
    pub(super) fn transposed(self) -> Self {
        Self {
            rows: self.cols,
            cols: self.rows,
            row_stride: self.col_stride,
            col_stride: self.row_stride,
            ..self
        }
    }
}

/// What happens to the numbers that are already in the product's place.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Existing {
    Replace,
    Add,
}

/// `product` (rows of a × columns of b, rows `row_stride` apart) ← \[product +\] `scale`·a·b, on this thread alone.
pub(super) fn multiply(
    scale: f32,
    a: Matrix,
    b: Matrix,
    existing: Existing,
    product: &mut [f32],
    row_stride: usize,
) {
    let (m, k, n) = (a.rows, a.cols, b.cols);
    assert_eq!(k, b.rows, "inner sizes differ");
    assert!(row_stride >= n && product.len() >= (m - 1) * row_stride + n);
    // SAFETY: `Matrix` holds that each (i, j) of `a` and `b` lies in its slice; the assertion above holds it for
    // `product`, which is exclusive and therefore does not overlap them. All m, k, n are above zero.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            product.as_mut_ptr(),
            1,
            row_stride as isize,
            existing == Existing::Add,
            a.data.as_ptr(),
            a.col_stride as isize,
            a.row_stride as isize,
            b.data.as_ptr(),
            b.col_stride as isize,
            b.row_stride as isize,
            1.0,
            scale,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_and_transposes_multiply_as_written_out() {
        let numbers: Vec<f32> = (0..60).map(|i| ((i * 7) % 11) as f32 - 5.0).collect();
        let a = Matrix::new(&numbers, 3, 4, 5); // a block of wider rows
        let b = Matrix::new(&numbers[7..], 2, 4, 6).transposed();
        let mut product = vec![1.0; 3 * 3];
        multiply(0.5, a, b, Existing::Add, &mut product, 3);
        for i in 0..3 {
            for j in 0..2 {
                let dot: f32 = (0..4)
                    .map(|k| numbers[i * 5 + k] * numbers[7 + j * 6 + k])
                    .sum();
                assert_eq!(product[i * 3 + j], 1.0 + 0.5 * dot);
            }
            assert_eq!(product[i * 3 + 2], 1.0, "outside of the product");
        }
        multiply(1.0, a, b, Existing::Replace, &mut product, 3);
        let dot: f32 = (0..4).map(|k| numbers[k] * numbers[7 + k]).sum();
        assert_eq!(product[0], dot);
    }

    #[test]
    #[should_panic]
    fn a_view_beyond_its_slice_is_refused() {
        Matrix::new(&[0.0; 5], 2, 3, 3);
    }
}
