//! Matrix multiplication: checked views in, `unsafe` calls behind.

use crate::math::{Kernel, widest};

/// A read-only matrix over a slice, with strides, so that blocks and transposes need no copy.
#[derive(Clone, Copy)]
pub(in crate::network) struct Matrix<'a> {
    data: &'a [f32],
    rows: usize,
    cols: usize,
    row_stride: usize,
    col_stride: usize,
}

impl<'a> Matrix<'a> {
    /// Row-major `rows` × `cols`, its rows `row_stride` ≥ `cols` apart. Panics where `data` is too short: a bug here.
    pub(in crate::network) fn new(
        data: &'a [f32],
        rows: usize,
        cols: usize,
        row_stride: usize,
    ) -> Self {
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
    pub(in crate::network) fn transposed(self) -> Self {
        Self {
            rows: self.cols,
            cols: self.rows,
            row_stride: self.col_stride,
            col_stride: self.row_stride,
            ..self
        }
    }
}

/// Treatment of the numbers that are already in the product's place.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::network) enum Existing {
    Replace,
    Add,
}

/// Most products that matrixmultiply adds up in one run; longer sums are split there, and rounded once more.
const LONGEST_SUM: usize = 256;
/// Most elements of a product that are computed one by one.
const FEW: usize = 256;

/// `product` (rows of a × columns of b, rows `row_stride` apart) ← \[product +\] `scale`·a·b, on this thread alone.
///
/// Each element is one chain of fused multiply-adds, in the order of the inner index; where a few elements each have
/// two contiguous vectors, in sixteen lanes. So no bit depends on the width of the processor's vectors.
pub(in crate::network) fn multiply(
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
    let contiguous = a.col_stride == 1 && b.row_stride == 1;
    if existing == Existing::Replace && m * n <= FEW && contiguous {
        return widest(Dots {
            scale,
            a,
            b,
            product,
            row_stride,
        });
    }
    if existing == Existing::Add && scale == 1.0 && (m == 1 || k <= 2) && b.col_stride == 1 {
        return widest(Outer {
            a,
            b,
            product,
            row_stride,
        });
    }
    let [(a_row, a_col), (b_row, b_col)] =
        [a, b].map(|m| (m.row_stride as isize, m.col_stride as isize));
    let (a, b, out, out_row) = (
        a.data.as_ptr(),
        b.data.as_ptr(),
        product.as_mut_ptr(),
        row_stride as isize,
    );
    // SAFETY, of both calls: `Matrix` holds that each (i, j) of `a` and `b` lies in its slice; the assertion above holds
    // it for `product`, which is exclusive and therefore does not overlap them. All m, k, n are above zero.
    if k <= LONGEST_SUM {
        let kept = if existing == Existing::Add { 1.0 } else { 0.0 };
        unsafe {
            matrixmultiply::sgemm(
                m, k, n, scale, a, a_row, a_col, b, b_row, b_col, kept, out, out_row, 1,
            );
        }
    } else {
        let kept = existing == Existing::Add;
        let sequential = gemm::Parallelism::None;
        unsafe {
            gemm::gemm(
                m, n, k, out, 1, out_row, kept, a, a_col, a_row, b, b_col, b_row, 1.0, scale,
                false, false, false, sequential,
            );
        }
    }
}

/// A product of few elements, each of two contiguous vectors.
struct Dots<'a> {
    scale: f32,
    a: Matrix<'a>,
    b: Matrix<'a>,
    product: &'a mut [f32],
    row_stride: usize,
}

impl Kernel for Dots<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { scale, a, b, .. } = self;
        let rows = self.product.chunks_mut(self.row_stride).take(a.rows);
        for (i, row) in rows.enumerate() {
            let a = &a.data[i * a.row_stride..][..a.cols];
            for (j, value) in row[..b.cols].iter_mut().enumerate() {
                *value = scale * dot(a, &b.data[j * b.col_stride..][..b.rows]);
            }
        }
    }
}

/// Adds a product of few terms, or of one row, whose right side has contiguous rows.
struct Outer<'a> {
    a: Matrix<'a>,
    b: Matrix<'a>,
    product: &'a mut [f32],
    row_stride: usize,
}

impl Kernel for Outer<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { a, b, .. } = self;
        let rows = self.product.chunks_mut(self.row_stride).take(a.rows);
        for (i, row) in rows.enumerate() {
            for l in 0..a.cols {
                let factor = a.data[i * a.row_stride + l * a.col_stride];
                let b = &b.data[l * b.row_stride..][..b.cols];
                for (value, b) in row.iter_mut().zip(b) {
                    *value = b.mul_add(factor, *value);
                }
            }
        }
    }
}

/// Σ a·b in sixteen lanes, which are then added in halves.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    const LANES: usize = 16;
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0f32; LANES];
    for (a, b) in a.iter().zip(b) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum = a.mul_add(*b, *sum);
        }
    }
    for ((sum, a), b) in sums.iter_mut().zip(a_rest).zip(b_rest) {
        *sum = a.mul_add(*b, *sum);
    }
    for half in [8, 4, 2, 1] {
        let (low, high) = sums.split_at_mut(half);
        for (low, high) in low.iter_mut().zip(high) {
            *low += *high;
        }
    }
    sums[0]
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

    /// Every size gives what plain sums give.
    #[test]
    fn all_ways_of_multiplying_agree() {
        let numbers: Vec<f32> = (0..40_000).map(|i| ((i * 37) % 29) as f32 - 14.0).collect();
        for (m, k, n) in [
            (1, 9, 300),
            (5, 2, 7),
            (3, 40, 50),
            (17, 20, 33),
            (20, 300, 30),
        ] {
            for existing in [Existing::Replace, Existing::Add] {
                for turned in [false, true] {
                    let a = Matrix::new(&numbers, m, k, k);
                    let b = if turned {
                        Matrix::new(&numbers[3..], n, k, k).transposed()
                    } else {
                        Matrix::new(&numbers[3..], k, n, n)
                    };
                    let mut product = vec![1.0; m * n];
                    multiply(1.0, a, b, existing, &mut product, n);
                    for (i, row) in product.chunks_exact(n).enumerate() {
                        for (j, value) in row.iter().enumerate() {
                            let term = |l: usize| {
                                numbers[i * k + l] * b.data[l * b.row_stride + j * b.col_stride]
                            };
                            let kept = if existing == Existing::Add { 1.0 } else { 0.0 };
                            // Whole numbers: exact in any order.
                            assert_eq!(*value, kept + (0..k).map(term).sum::<f32>());
                        }
                    }
                }
            }
        }
    }

    #[test]
    #[should_panic]
    fn a_view_beyond_its_slice_is_refused() {
        Matrix::new(&[0.0; 5], 2, 3, 3);
    }
}
