//! Sizes of a run, and where its numbers are kept.

use crate::math::Number;

/// States n and outputs p of a run. The pass is compiled for each implementation, so that loops over a [`Fixed`]
/// size have known ends and numbers lie side by side.
pub(super) trait Size: Copy + Send {
    /// n or p numbers.
    type Vector<N: Number>: Buffer<N>;
    /// n × n numbers.
    type Matrix<N: Number>: Buffer<N>;

    /// `true` if sizes are known when this is compiled.
    const KNOWN: bool;

    fn states(self) -> usize;
    fn outputs(self) -> usize;
}

/// Numbers one after the other.
pub(super) trait Buffer<N>: Send {
    /// At least `length` zeros.
    fn zeros(length: usize) -> Self;
    fn numbers(&self) -> &[N];
    fn numbers_mut(&mut self) -> &mut [N];
}

impl<N: Number, const LENGTH: usize> Buffer<N> for [N; LENGTH] {
    #[inline(always)]
    fn zeros(length: usize) -> Self {
        debug_assert!(length <= LENGTH);
        [N::ZERO; LENGTH]
    }
    #[inline(always)]
    fn numbers(&self) -> &[N] {
        self
    }
    #[inline(always)]
    fn numbers_mut(&mut self) -> &mut [N] {
        self
    }
}

impl<N: Number, const ROWS: usize, const COLUMNS: usize> Buffer<N> for [[N; COLUMNS]; ROWS] {
    #[inline(always)]
    fn zeros(length: usize) -> Self {
        debug_assert!(length <= ROWS * COLUMNS);
        [[N::ZERO; COLUMNS]; ROWS]
    }
    #[inline(always)]
    fn numbers(&self) -> &[N] {
        self.as_flattened()
    }
    #[inline(always)]
    fn numbers_mut(&mut self) -> &mut [N] {
        self.as_flattened_mut()
    }
}

impl<N: Number> Buffer<N> for Vec<N> {
    fn zeros(length: usize) -> Self {
        vec![N::ZERO; length]
    }
    #[inline(always)]
    fn numbers(&self) -> &[N] {
        self
    }
    #[inline(always)]
    fn numbers_mut(&mut self) -> &mut [N] {
        self
    }
}

/// N states and one output.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fixed<const STATES: usize>;

impl<const STATES: usize> Size for Fixed<STATES> {
    type Vector<N: Number> = [N; STATES];
    type Matrix<N: Number> = [[N; STATES]; STATES];

    const KNOWN: bool = true;

    #[inline(always)]
    fn states(self) -> usize {
        STATES
    }
    #[inline(always)]
    fn outputs(self) -> usize {
        1
    }
}

/// Any number of states and outputs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Any {
    pub states: usize,
    pub outputs: usize,
}

impl Size for Any {
    type Vector<N: Number> = Vec<N>;
    type Matrix<N: Number> = Vec<N>;

    const KNOWN: bool = false;

    fn states(self) -> usize {
        self.states
    }
    fn outputs(self) -> usize {
        self.outputs
    }
}

/// Evaluates an expression with the size of a filter bound to a name: a [`Fixed`] one where it is listed, or else the last expression.
macro_rules! with_size {
    (($states:expr, $outputs:expr), [$($known:literal)+], |$size:ident| $known_do:expr, $else_do:expr) => {
        match ($states, $outputs) {
            $(($known, 1) => {
                let $size = $crate::likelihood::kalman::size::Fixed::<$known>;
                $known_do
            })+
            _ => $else_do,
        }
    };
}
pub(super) use with_size;
