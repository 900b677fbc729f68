//! Operations over groups of numbers.

use crate::equations::expression::{Binary, OnOne, OnTwo, Unary};
use crate::math::{Kernel, LANES, widest};
use std::cell::Cell;

/// First number of a value, and the way from one group to the next.
pub(super) type Place = (u32, u32);

/// An operation with its places among the numbers of a thread.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlacedOperation {
    pub work: Work,
    pub to: Place,
    pub of: [Place; 3],
}

/// An operation on one, two or three numbers.
#[derive(Debug, Clone, Copy)]
pub(super) enum Work {
    One(Unary),
    Two(Binary),
    If,
}

#[inline(always)]
pub(super) fn load<const G: usize>(numbers: &[Cell<f64>], at: usize) -> [f64; G] {
    let mut values = [0.0; G];
    for (to, from) in values.iter_mut().zip(&numbers[at..at + G]) {
        *to = from.get();
    }
    values
}

#[inline(always)]
pub(super) fn store<const G: usize>(numbers: &[Cell<f64>], at: usize, values: [f64; G]) {
    for (to, value) in numbers[at..at + G].iter().zip(values) {
        to.set(value);
    }
}

/// A loop over groups of numbers. Plain loops throughout: closures inside of them would be calls.
struct Groups<'n, const G: usize> {
    numbers: &'n [Cell<f64>],
    count: usize,
    to: Place,
    of: [Place; 3],
}

impl<const G: usize> Groups<'_, G> {
    #[inline(always)]
    fn load(&self, operand: usize, group: usize) -> [f64; G] {
        let (start, step) = self.of[operand];
        load(self.numbers, start as usize + group * step as usize)
    }

    #[inline(always)]
    fn store(&self, group: usize, values: [f64; G]) {
        let (start, step) = self.to;
        store(self.numbers, start as usize + group * step as usize, values);
    }

    #[inline(always)]
    fn choose(&self) {
        for group in 0..self.count {
            let (c, mut a) = (self.load(0, group), self.load(1, group));
            let b = self.load(2, group);
            for i in 0..G {
                if c[i] == 0.0 {
                    a[i] = b[i];
                }
            }
            self.store(group, a);
        }
    }
}

impl<const G: usize> OnOne for Groups<'_, G> {
    #[inline(always)]
    fn each(self, function: impl Fn(f64) -> f64) {
        for group in 0..self.count {
            let mut a = self.load(0, group);
            for a in &mut a {
                *a = function(*a);
            }
            self.store(group, a);
        }
    }
}

impl<const G: usize> OnTwo for Groups<'_, G> {
    #[inline(always)]
    fn each(self, function: impl Fn(f64, f64) -> f64) {
        for group in 0..self.count {
            let (mut a, b) = (self.load(0, group), self.load(1, group));
            for (a, b) in a.iter_mut().zip(b) {
                *a = function(*a, b);
            }
            self.store(group, a);
        }
    }
}

impl PlacedOperation {
    /// Does it for so many groups.
    #[inline(always)]
    fn run<const G: usize>(&self, numbers: &[Cell<f64>], count: usize) {
        let groups = Groups::<G> {
            numbers,
            count,
            to: self.to,
            of: self.of,
        };
        match self.work {
            Work::One(operation) => operation.over(groups),
            Work::Two(operation) => operation.over(groups),
            Work::If => groups.choose(),
        }
    }
}

/// Operations one after the other, each over so many groups.
struct All<'n, const G: usize> {
    operations: &'n [PlacedOperation],
    numbers: &'n [Cell<f64>],
    count: usize,
}

impl<const G: usize> Kernel for All<'_, G> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for operation in self.operations {
            operation.run::<G>(self.numbers, self.count);
        }
    }
}

/// Does operations one after the other, each over so many groups; groups that fill the widest vectors, in these. It is compiled once for each
/// size of groups: whatever gives and takes the numbers pays a call.
#[inline(never)]
pub(super) fn run_all<const G: usize>(
    operations: &[PlacedOperation],
    numbers: &[Cell<f64>],
    count: usize,
) {
    let all = All::<G> {
        operations,
        numbers,
        count,
    };
    match G < LANES {
        true => all.run(),
        false => widest(all),
    }
}
