//! One step of any equations: of one state, or of all points of a filter at once.

use super::simulation::simulate_equations;
use crate::record::{Drive, Signal};
use crate::twin::{Advance, Noise, Now, Points, SimulationError, StateSpace, Workspace};

impl<T: StateSpace> Advance for T {
    #[inline]
    fn advance(&self, now: &Now<'_>, x: &mut [f64], work: &mut Workspace) {
        self.update(now, x);
        self.integrator()
            .step(now, x, work, |now, x, dx| self.drift(now, x, dx));
    }

    fn run_equations(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        simulate_equations(self, theta, drive, noise)
    }

    fn advance_each(&self, now: &Now<'_>, points: Points<'_>, work: &mut Workspace) -> bool {
        // Loops of known length, for the sizes of most twins.
        match points.shifts.len() {
            1 => advance_each(self, 1, now, points, work),
            2 => advance_each(self, 2, now, points, work),
            3 => advance_each(self, 3, now, points, work),
            n => advance_each(self, n, now, points, work),
        }
    }

    fn observe_each(&self, now: &Now<'_>, (n, p): (usize, usize), points: &[f64], y: &mut [f64]) {
        for (x, y) in points.chunks_exact(n).zip(y.chunks_exact_mut(p)) {
            self.observe(now, x, y);
        }
    }

    fn readout_each(&self, now: &Now<'_>, p: usize, y: &mut [f64]) -> bool {
        match p {
            1 => readout_each(self, 1, now, y),
            p => readout_each(self, p, now, y),
        }
    }
}

#[inline(always)]
fn readout_each<T: StateSpace>(twin: &T, p: usize, now: &Now<'_>, y: &mut [f64]) -> bool {
    let mut changed = false;
    for y in y.chunks_exact_mut(p) {
        changed |= changes(y, |y| twin.readout(now, y));
    }
    changed
}

#[inline(always)]
fn advance_each<T: StateSpace>(
    twin: &T,
    n: usize,
    now: &Now<'_>,
    points: Points<'_>,
    work: &mut Workspace,
) -> bool {
    let Points {
        moving,
        limits,
        shifted,
        shifts,
    } = points;
    let (limits, shifts) = (&limits[..n], &shifts[..n]);
    for x in moving.chunks_exact_mut(n) {
        for (x, limit) in x.iter_mut().zip(limits) {
            *x = limit.clamp(*x);
        }
        twin.advance(now, x, work);
    }
    let (centre, around) = moving.split_at_mut(n);
    let mut bent = false;
    for ((i, &shift), pair) in (shifts.iter().enumerate()).zip(shifted.chunks_exact_mut(2 * n)) {
        if shift == 0.0 {
            continue;
        }
        for (x, shift) in pair.chunks_exact_mut(n).zip([shift, -shift]) {
            for (j, (x, centre)) in x.iter_mut().zip(&*centre).enumerate() {
                *x = centre + if j == i { shift } else { 0.0 };
            }
            bent |= changes(x, |x| twin.constrain(now, x));
        }
    }
    // The centre last: the shifts start from it as it is before.
    for x in around.chunks_exact_mut(n) {
        twin.constrain(now, x);
    }
    bent | changes(centre, |x| twin.constrain(now, x))
}

/// Runs `with` and tells whether it changed `values`. Nothing is left of this for a `with` that does nothing.
#[inline(always)]
fn changes(values: &mut [f64], with: impl FnOnce(&mut [f64])) -> bool {
    let (mut few, many);
    let before = if values.len() <= 4 {
        few = [0.0; 4];
        few[..values.len()].copy_from_slice(values);
        &few[..values.len()]
    } else {
        many = values.to_vec();
        &many
    };
    with(values);
    let mut changed = false;
    for (value, before) in values.iter().zip(before) {
        changed |= value.to_bits() != before.to_bits();
    }
    changed
}
