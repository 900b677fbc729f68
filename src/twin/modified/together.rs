//! Points of a filter as one long state.

use crate::twin::points::shifted_value;
use crate::twin::{Layout, Now, Points, StateSpace, Workspace};

/// Carries all points as one long state, so that each equation is called once: for twins made of other twins.
#[inline(always)]
pub(super) fn advance_together<T: StateSpace>(
    twin: &T,
    n: usize,
    now: &Now<'_>,
    mut points: Points<'_>,
    work: &mut Workspace,
) -> bool {
    let (shifts, at) = (&points.shifts[..n], Layout::dense(n));
    points.limit(n);
    let (moving, shifted) = points.all.split_at_mut(points.moving * n);
    twin.update_each(now, at, moving);
    let drift = |now: &Now<'_>, x: &[f64], dx: &mut [f64]| twin.drift_each(now, at, x, dx);
    twin.integrator().carry(n, now, moving, work, drift);
    let pairs = || (shifts.iter().enumerate()).flat_map(|(i, s)| [(i, *s), (i, -s)]);
    let before = work.stage(n);
    before.copy_from_slice(&moving[..n]);
    for (x, of) in shifted.chunks_exact_mut(n).zip(pairs()) {
        for (j, x) in x.iter_mut().enumerate() {
            *x = shifted_value(before, of, j);
        }
    }
    twin.constrain_each(now, at, points.all);
    let (moving, shifted) = points.all.split_at(points.moving * n);
    let mut bent = false;
    for (x, before) in moving[..n].iter().zip(&*before) {
        bent |= x.to_bits() != before.to_bits();
    }
    for (x, of) in shifted.chunks_exact(n).zip(pairs()) {
        for (j, x) in x.iter().enumerate() {
            bent |= x.to_bits() != shifted_value(before, of, j).to_bits();
        }
    }
    bent
}
