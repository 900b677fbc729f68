//! The operations of expressions.

use std::cell::Cell;

/// Work on all numbers of a block, compiled once for each function of one number.
pub(in crate::equations) trait OnOne {
    fn each(self, function: impl Fn(f64) -> f64);
}

/// As [`OnOne`], for functions of two numbers.
pub(in crate::equations) trait OnTwo {
    fn each(self, function: impl Fn(f64, f64) -> f64);
}

macro_rules! operations {
    ($(#[$doc:meta])* $Kind:ident, $Work:ident, $($Name:ident => $function:expr),+ $(,)?) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub(in crate::equations) enum $Kind { $($Name),+ }

        impl $Kind {
            /// Hands the function to a loop.
            #[inline(always)]
            pub fn over(self, work: impl $Work) {
                match self { $(Self::$Name => work.each($function)),+ }
            }
        }
    };
}

operations! {
    /// Operations on one number.
    Unary, OnOne,
    Neg => |a| -a,
    Not => |a| truth(a == 0.0),
    Abs => |a| a.abs(),
    Sign => |a| truth(a > 0.0) - truth(a < 0.0) + 0.0 * a,
    Sqrt => |a| a.sqrt(),
    Exp => |a| a.exp(),
    Ln => |a| a.ln(),
    Log10 => |a| a.log10(),
    Sin => |a| a.sin(),
    Cos => |a| a.cos(),
    Tan => |a| a.tan(),
    Asin => |a| a.asin(),
    Acos => |a| a.acos(),
    Atan => |a| a.atan(),
    Sinh => |a| a.sinh(),
    Cosh => |a| a.cosh(),
    Tanh => |a| a.tanh(),
    Floor => |a| a.floor(),
}

operations! {
    /// Operations on two numbers.
    Binary, OnTwo,
    Add => |a, b| a + b,
    Sub => |a, b| a - b,
    Mul => |a, b| a * b,
    Div => |a, b| a / b,
    Pow => |a, b| a.powf(b),
    // A first number that is none stays so: a run that has diverged does not come back.
    Min => |a, b| if b < a { b } else { a },
    Max => |a, b| if a < b { b } else { a },
    Atan2 => |a, b| a.atan2(b),
    Mod => |a, b| a - b * (a / b).floor(),
    Less => |a, b| truth(a < b),
    LessEqual => |a, b| truth(a <= b),
    Equal => |a, b| truth(a == b),
    NotEqual => |a, b| truth(a != b),
    And => |a, b| truth(a != 0.0 && b != 0.0),
    Or => |a, b| truth(a != 0.0 || b != 0.0),
}

#[inline(always)]
fn truth(is_true: bool) -> f64 {
    if is_true { 1.0 } else { 0.0 }
}

/// One value, for [`Unary::value`] and [`Binary::value`].
struct Once<'r, const N: usize>([f64; N], &'r Cell<f64>);

impl OnOne for Once<'_, 1> {
    fn each(self, function: impl Fn(f64) -> f64) {
        self.1.set(function(self.0[0]));
    }
}

impl OnTwo for Once<'_, 2> {
    fn each(self, function: impl Fn(f64, f64) -> f64) {
        self.1.set(function(self.0[0], self.0[1]));
    }
}

impl Unary {
    /// Value of one number.
    pub fn value(self, a: f64) -> f64 {
        let value = Cell::new(0.0);
        self.over(Once([a], &value));
        value.get()
    }
}

impl Binary {
    /// Value of two numbers.
    pub fn value(self, a: f64, b: f64) -> f64 {
        let value = Cell::new(0.0);
        self.over(Once([a, b], &value));
        value.get()
    }
}

/// A function as expressions call it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::equations) enum Callable {
    One(Unary),
    Two(Binary),
    /// Two numbers or more, from the left.
    Several(Binary),
    /// `if(condition, then, else)`: both are computed, one is taken.
    If,
    /// `clamp(x, low, high)`.
    Clamp,
}

/// Scope of functions.
pub(in crate::equations) const FUNCTIONS: [(&str, Callable); 23] = [
    ("min", Callable::Several(Binary::Min)),
    ("max", Callable::Several(Binary::Max)),
    ("abs", Callable::One(Unary::Abs)),
    ("sign", Callable::One(Unary::Sign)),
    ("sqrt", Callable::One(Unary::Sqrt)),
    ("exp", Callable::One(Unary::Exp)),
    ("ln", Callable::One(Unary::Ln)),
    ("log10", Callable::One(Unary::Log10)),
    ("sin", Callable::One(Unary::Sin)),
    ("cos", Callable::One(Unary::Cos)),
    ("tan", Callable::One(Unary::Tan)),
    ("asin", Callable::One(Unary::Asin)),
    ("acos", Callable::One(Unary::Acos)),
    ("atan", Callable::One(Unary::Atan)),
    ("atan2", Callable::Two(Binary::Atan2)),
    ("sinh", Callable::One(Unary::Sinh)),
    ("cosh", Callable::One(Unary::Cosh)),
    ("tanh", Callable::One(Unary::Tanh)),
    ("floor", Callable::One(Unary::Floor)),
    ("mod", Callable::Two(Binary::Mod)),
    ("pow", Callable::Two(Binary::Pow)),
    ("clamp", Callable::Clamp),
    ("if", Callable::If),
];

impl Callable {
    /// Returns the function of this name.
    pub fn named(name: &str) -> Option<Self> {
        let mut all = FUNCTIONS.iter();
        all.find(|(known, _)| *known == name).map(|(_, f)| *f)
    }

    /// Returns least and most numbers that it takes.
    pub fn arity(self) -> (usize, usize) {
        match self {
            Self::One(_) => (1, 1),
            Self::Two(_) => (2, 2),
            Self::Several(_) => (2, usize::MAX),
            Self::If | Self::Clamp => (3, 3),
        }
    }
}
