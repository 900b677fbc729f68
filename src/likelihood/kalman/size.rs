//! Sizes of a run, and where its numbers are kept.

/// States n and outputs p of a run. The pass is compiled for each implementation, so that loops over a [`Fixed`]
/// size have known ends and numbers lie side by side.
pub(super) trait Size: Copy {
    /// n or p numbers.
    type Vector: Numbers;
    /// n × n numbers.
    type Matrix: Numbers;
    /// A centre and four points for each state: (1 + 4·n)·n numbers.
    type Points: Numbers;

    /// `true` if sizes are known when this is compiled.
    const KNOWN: bool;

    fn states(self) -> usize;
    fn outputs(self) -> usize;
}

/// A buffer.
pub(super) trait Numbers: AsRef<[f64]> + AsMut<[f64]> {
    /// At least `length` zeros.
    fn zeros(length: usize) -> Self;
}

impl<const CAPACITY: usize> Numbers for [f64; CAPACITY] {
    fn zeros(length: usize) -> Self {
        debug_assert!(length <= CAPACITY);
        [0.0; CAPACITY]
    }
}

impl Numbers for Vec<f64> {
    fn zeros(length: usize) -> Self {
        vec![0.0; length]
    }
}

/// N states, up to ten, and one output.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fixed<const N: usize>;

macro_rules! fixed {
    ($($n:literal),+) => {
        $(impl Size for Fixed<$n> {
            type Vector = [f64; $n];
            type Matrix = [f64; $n * $n];
            type Points = [f64; (1 + 4 * $n) * $n];

            const KNOWN: bool = true;

            #[inline(always)]
            fn states(self) -> usize {
                $n
            }
            #[inline(always)]
            fn outputs(self) -> usize {
                1
            }
        })+
    };
}

fixed!(1, 2, 3, 4, 5, 6, 7, 8, 9, 10);

/// Any number of states and outputs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Any {
    pub states: usize,
    pub outputs: usize,
}

impl Size for Any {
    type Vector = Vec<f64>;
    type Matrix = Vec<f64>;
    type Points = Vec<f64>;

    const KNOWN: bool = false;

    fn states(self) -> usize {
        self.states
    }
    fn outputs(self) -> usize {
        self.outputs
    }
}
