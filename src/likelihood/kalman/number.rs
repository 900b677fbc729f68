//! Calls of the twin by a filter, whose numbers are one or those of several filters side by side. Equations in Rust are plain f64.

use crate::math::{Lanes, Mask, Number};
use crate::twin::{Composed, LanePlaces, LevelFactors, Points, Workspace};

/// A number that a filter computes with.
pub(super) trait FilterNumber: Number {
    /// Puts points into the limits and carries them over a step; the lanes in which a constraint acted.
    fn advance(call: Call<'_, '_>, points: Points<'_, Self>) -> Self::Condition;
    /// Outputs of points of `n` states each.
    fn observe(call: Call<'_, '_>, n: usize, points: &[Self], outputs: &mut [Self]);
    /// Noise levels at the states `x`; both come with any numbers.
    fn noise(
        asked: (&Composed, &mut LanePlaces<'_>, &LevelFactors<Self>),
        x: &[Self],
        process: &mut [Self],
        measurement: &mut [Self],
    );
    /// Puts outputs through the readout; the lanes in which it changed any.
    fn readout(at: Asked<'_, '_>, outputs: &mut [Self]) -> Self::Condition;
}

/// A twin, and where its filters are.
pub(super) type Asked<'c, 'n> = (&'c Composed, &'c LanePlaces<'n>);

/// The same, with buffers.
pub(super) struct Call<'c, 'n> {
    pub twin: &'c Composed,
    pub now: &'c LanePlaces<'n>,
    pub buffers: &'c mut Buffers,
}

/// Buffers of calls to a twin.
pub(super) struct Buffers {
    work: Workspace,
    one: Vec<f64>,
    shift: Vec<f64>,
}

impl Buffers {
    pub fn new(twin: &Composed, n: usize) -> Self {
        Self {
            work: twin.workspace(),
            one: vec![0.0; (1 + 4 * n) * n],
            shift: vec![0.0; n],
        }
    }
}

impl Buffers {
    /// Returns what is wrong with points whose events have no end.
    pub fn fault(&self) -> Option<&str> {
        self.work.fault()
    }
}

impl FilterNumber for f64 {
    #[inline(always)]
    fn advance(call: Call<'_, '_>, points: Points<'_, Self>) -> bool {
        (call.twin).advance(&call.now.whole()[0], points, &mut call.buffers.work)
    }
    #[inline(always)]
    fn observe(call: Call<'_, '_>, _: usize, points: &[f64], outputs: &mut [f64]) {
        call.twin.observe(&call.now.whole()[0], points, outputs);
    }
    #[inline(always)]
    fn noise(
        (twin, now, factors): (&Composed, &mut LanePlaces<'_>, &LevelFactors<f64>),
        x: &[f64],
        process: &mut [f64],
        measurement: &mut [f64],
    ) {
        process.fill(0.0);
        measurement.fill(0.0);
        twin.noise_by(factors, &now.whole()[0], x, (process, measurement));
    }
    #[inline(always)]
    fn readout((twin, now): Asked<'_, '_>, outputs: &mut [f64]) -> bool {
        twin.readout(&now.whole()[0], outputs)
    }
}

/// One output.
impl FilterNumber for Lanes {
    #[inline(always)]
    fn advance(call: Call<'_, '_>, points: Points<'_, Self>) -> Mask {
        let Buffers { work, one, shift } = call.buffers;
        let bent = (call.twin).advance_lanes(call.now, points, (one, shift), work);
        Mask::of(|lane| bent[lane])
    }
    #[inline(always)]
    fn observe(call: Call<'_, '_>, n: usize, points: &[Self], outputs: &mut [Self]) {
        let buffer = &mut call.buffers.one;
        call.twin
            .observe_lanes(call.now, n, points, outputs, buffer);
    }
    #[inline(always)]
    fn noise(
        (twin, now, factors): (&Composed, &mut LanePlaces<'_>, &LevelFactors<Self>),
        x: &[Self],
        process: &mut [Self],
        measurement: &mut [Self],
    ) {
        twin.noise_lanes(factors, now, x, (process, &mut measurement[0]));
    }
    #[inline(always)]
    fn readout((twin, now): Asked<'_, '_>, outputs: &mut [Self]) -> Mask {
        let changed = twin.readout_lanes(now, outputs);
        Mask::of(|lane| changed[lane])
    }
}
