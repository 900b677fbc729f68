//! Several states side by side, carried through equations by one call.

use crate::math::{LANES, Lanes};
use crate::twin::{Interval, Now, Workspace};

/// So many numbers are kept on the stack.
const FEW: usize = 4;

/// Layout of points side by side: each takes `stride` numbers, and the first `states` of these are the twin's.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    /// Number of states of the twin.
    pub states: usize,
    /// Numbers from one point to the next.
    pub stride: usize,
}

impl Layout {
    /// Creates the layout of points with nothing between them.
    #[inline(always)]
    pub(crate) fn dense(states: usize) -> Self {
        Self {
            states,
            stride: states,
        }
    }

    /// Returns the states of each point.
    #[inline(always)]
    pub(crate) fn each(self, x: &[f64]) -> impl ExactSizeIterator<Item = &[f64]> {
        x.chunks_exact(self.stride).map(move |x| &x[..self.states])
    }

    /// As [`each`](Self::each), to be changed.
    #[inline(always)]
    pub(crate) fn each_mut(self, x: &mut [f64]) -> impl ExactSizeIterator<Item = &mut [f64]> {
        (x.chunks_exact_mut(self.stride)).map(move |x| &mut x[..self.states])
    }
}

/// Points that a filter carries over a step, or several filters side by side, one a lane; n states each, one point after the other.
#[derive(Debug)]
pub(crate) struct Points<'w, N = f64> {
    /// First the `moving` points: put into the limits, advanced, constrained; the first is the centre. Behind them two for each state: the
    /// centre after its motion, with that state shifted up and down, constrained. Those of a state without shift hold nothing of use, nor do
    /// those of a lane where no constraint acted.
    pub all: &'w mut [N],
    /// Number of moving points; one and two for each state in lanes.
    pub moving: usize,
    /// Limits by state.
    pub limits: &'w [Interval],
    /// Shift of each state.
    pub shifts: &'w [N],
}

/// Where filters are, one a lane: with all of θ, as parts of a twin see it, and with that of its own equations.
#[derive(Debug)]
pub(crate) struct LanePlaces<'n> {
    whole: Vec<Now<'n>>,
    /// Empty where θ is the same.
    own: Vec<Now<'n>>,
}

impl<'n> LanePlaces<'n> {
    /// Creates those of equations with so many parameters.
    pub fn new(whole: Vec<Now<'n>>, parameters: usize) -> Self {
        let own = (whole.iter())
            .filter(|now| now.theta.len() > parameters)
            .map(|now| Now {
                theta: &now.theta[..parameters],
                ..*now
            })
            .collect();
        Self { whole, own }
    }

    /// Creates that of a single filter, whose twin cuts θ itself.
    pub fn of_one(whole: Now<'n>) -> Self {
        Self {
            whole: vec![whole],
            own: vec![],
        }
    }

    /// With all of θ.
    #[inline(always)]
    pub fn whole(&self) -> &[Now<'n>] {
        &self.whole
    }

    /// With θ of the equations.
    #[inline(always)]
    pub fn own(&self) -> &[Now<'n>] {
        match self.own.is_empty() {
            true => &self.whole,
            false => &self.own,
        }
    }

    /// Calls `then` with θ of the equations and another step, where one is given.
    pub fn own_in_step(&mut self, step: Option<f64>, then: impl FnOnce(&[Now<'n>])) {
        let Some(step) = step else {
            return then(self.own());
        };
        let own = match self.own.is_empty() {
            true => &mut self.whole,
            false => &mut self.own,
        };
        let mut before = [0.0; LANES];
        for (now, before) in own.iter_mut().zip(&mut before) {
            *before = std::mem::replace(&mut now.dt, step);
        }
        then(own);
        for (now, before) in own.iter_mut().zip(before) {
            now.dt = before;
        }
    }

    /// Moves all to another row, θ kept; `go` is told the lane.
    #[inline(always)]
    pub fn each(&mut self, mut go: impl FnMut(usize, &mut Now<'n>)) {
        for all in [&mut self.whole, &mut self.own] {
            for (lane, now) in all.iter_mut().enumerate() {
                let theta = now.theta;
                go(lane, now);
                now.theta = theta;
            }
        }
    }
}

/// Copies one lane out.
#[inline(always)]
pub(super) fn gather(from: &[Lanes], lane: usize, to: &mut [f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = from.0[lane];
    }
}

/// Copies one lane in; the first also into the lanes that no filter uses.
#[inline(always)]
pub(super) fn scatter(from: &[f64], (lane, used): (usize, usize), to: &mut [Lanes]) {
    for (to, from) in to.iter_mut().zip(from) {
        to.0[lane] = *from;
    }
    if lane == 0 && used < LANES {
        for (to, from) in to.iter_mut().zip(from) {
            to.0[used..].fill(*from);
        }
    }
}

impl Points<'_> {
    /// Puts the moving points into their limits.
    #[inline(always)]
    pub(in crate::twin) fn limit(&mut self, n: usize) {
        let limits = &self.limits[..n];
        for x in self.all[..self.moving * n].chunks_exact_mut(n) {
            for (x, limit) in x.iter_mut().zip(limits) {
                *x = limit.clamp(*x);
            }
        }
    }
}

/// Value of state j in the point whose state i is shifted.
#[inline(always)]
fn shifted_value(centre: &[f64], (i, shift): (usize, f64), j: usize) -> f64 {
    if j == i { centre[j] + shift } else { centre[j] }
}

/// Carries one point after the other, the equations inline: for twins that users write.
#[inline(always)]
pub(super) fn advance_one_by_one(
    n: usize,
    mut points: Points<'_>,
    mut advance: impl FnMut(&mut [f64]),
    constrain: impl Fn(&mut [f64]),
) -> bool {
    points.limit(n);
    let shifts = &points.shifts[..n];
    let (moving, shifted) = points.all.split_at_mut(points.moving * n);
    for x in moving.chunks_exact_mut(n) {
        advance(x);
    }
    let (centre, around) = moving.split_at_mut(n);
    let mut bent = false;
    for ((i, &shift), pair) in (shifts.iter().enumerate()).zip(shifted.chunks_exact_mut(2 * n)) {
        if shift == 0.0 {
            continue;
        }
        for (x, shift) in pair.chunks_exact_mut(n).zip([shift, -shift]) {
            for (j, x) in x.iter_mut().enumerate() {
                *x = shifted_value(centre, (i, shift), j);
            }
            // Few numbers are copied, and nothing is left of it for a twin without constraints; many are not.
            if n <= FEW {
                bent |= changes(x, &constrain);
                continue;
            }
            constrain(x);
            for (j, x) in x.iter().enumerate() {
                bent |= x.to_bits() != shifted_value(centre, (i, shift), j).to_bits();
            }
        }
    }
    // The centre last: the shifts start from it as it is before.
    for x in around.chunks_exact_mut(n) {
        constrain(x);
    }
    bent | changes(centre, constrain)
}

/// Carries all points as one long state, so that each equation is called once, and steps to a tolerance are those of all points.
#[inline(always)]
pub(super) fn advance_together(
    n: usize,
    mut points: Points<'_>,
    work: &mut Workspace,
    carry: impl FnOnce(&mut [f64], &mut Workspace),
    constrain: impl FnOnce(&mut [f64]),
) -> bool {
    points.limit(n);
    carry(&mut points.all[..points.moving * n], work);
    constrain_together(n, points, work, constrain)
}

/// Constrains points that have moved, and the shifted ones; returns whether that acted on any that matters to the noise.
#[inline(always)]
pub(super) fn constrain_together(
    n: usize,
    points: Points<'_>,
    work: &mut Workspace,
    constrain: impl FnOnce(&mut [f64]),
) -> bool {
    let shifts = &points.shifts[..n];
    let (moving, shifted) = points.all.split_at_mut(points.moving * n);
    let before = work.stages().stage(n);
    before.copy_from_slice(&moving[..n]);
    for ((i, shift), pair) in shifts
        .iter()
        .enumerate()
        .zip(shifted.chunks_exact_mut(2 * n))
    {
        for (x, shift) in pair.chunks_exact_mut(n).zip([*shift, -shift]) {
            x.copy_from_slice(before);
            x[i] += shift;
        }
    }
    constrain(points.all);
    let (moving, shifted) = points.all.split_at(points.moving * n);
    let mut bent = differ(&moving[..n], before);
    for ((i, shift), pair) in shifts.iter().enumerate().zip(shifted.chunks_exact(2 * n)) {
        let centre = before[i];
        for (x, shift) in pair.chunks_exact(n).zip([*shift, -shift]) {
            before[i] = centre + shift;
            bent |= differ(x, before);
        }
        before[i] = centre;
    }
    bent
}

/// Returns whether any bit differs.
#[inline(always)]
fn differ(x: &[f64], y: &[f64]) -> bool {
    (x.iter().zip(y)).fold(false, |any, (x, y)| any | (x.to_bits() != y.to_bits()))
}

/// Carries the points of several filters, one after the other; returns the lanes in which a constraint acted. The buffers hold points and
/// shifts of one lane.
#[inline(always)]
pub(super) fn lanes_one_by_one(
    n: usize,
    now: &[Now<'_>],
    points: Points<'_, Lanes>,
    (one, shift): (&mut [f64], &mut [f64]),
    mut advance: impl FnMut(&Now<'_>, Points<'_>) -> bool,
) -> [bool; LANES] {
    let (moving, length) = (1 + 2 * n, (1 + 4 * n) * n);
    let (all, one) = (&mut points.all[..length], &mut one[..length]);
    let (shifts, shift) = (&points.shifts[..n], &mut shift[..n]);
    let mut bent = [false; LANES];
    for (lane, at) in now.iter().enumerate() {
        gather(&all[..moving * n], lane, &mut one[..moving * n]);
        gather(shifts, lane, shift);
        let point = Points {
            all: &mut *one,
            moving,
            limits: points.limits,
            shifts: &*shift,
        };
        bent[lane] = advance(at, point);
        scatter_moved(moving * n, one, (lane, now.len(), bent[lane]), all);
    }
    bent
}

/// Copies the first `moving` numbers of one lane in, the others only where a constraint acted.
#[inline(always)]
pub(super) fn scatter_moved(
    moving: usize,
    from: &[f64],
    (lane, used, is_bent): (usize, usize, bool),
    to: &mut [Lanes],
) {
    let count = if is_bent { from.len() } else { moving };
    scatter(&from[..count], (lane, used), &mut to[..count]);
}

/// States of a twin in lanes, at most.
pub(crate) const MOST_STATES: usize = 4;

/// Output of the points of several filters, one after the other.
#[inline(always)]
pub(super) fn observe_lanes(
    n: usize,
    now: &[Now<'_>],
    x: &[Lanes],
    y: &mut [Lanes],
    buffer: &mut [f64],
    observe: impl Fn(&Now<'_>, &[f64], &mut [f64]),
) {
    let points = 1 + 2 * n;
    let (x, y) = (&x[..points * n], &mut y[..points]);
    let buffer = &mut buffer[..points * n];
    let mut outputs = [0.0; 1 + 2 * MOST_STATES];
    let outputs = &mut outputs[..points];
    for (lane, at) in now.iter().enumerate() {
        gather(x, lane, buffer);
        observe(at, buffer, outputs);
        scatter(outputs, (lane, now.len()), y);
    }
}

/// Noise levels of several filters with one output, one after the other.
#[inline(always)]
pub(super) fn noise_lanes(
    n: usize,
    now: &[Now<'_>],
    x: &[Lanes],
    (process, measurement): (&mut [Lanes], &mut Lanes),
    noise: impl Fn(&Now<'_>, &[f64], &mut [f64], &mut [f64]),
) {
    let (mut state, mut levels) = ([0.0; MOST_STATES], [0.0; MOST_STATES + 1]);
    let state = &mut state[..n];
    let (q, r) = levels[..=n].split_at_mut(n);
    for (lane, at) in now.iter().enumerate() {
        q.fill(0.0);
        r.fill(0.0);
        gather(&x[..n], lane, state);
        noise(at, state, q, r);
        scatter(q, (lane, now.len()), &mut process[..n]);
        scatter(r, (lane, now.len()), std::slice::from_mut(measurement));
    }
}

/// Puts values of one output of several filters through the readout; returns the lanes that it changed.
#[inline(always)]
pub(super) fn readout_lanes(
    now: &[Now<'_>],
    y: &mut [Lanes],
    readout: impl Fn(&Now<'_>, &mut [f64]) -> bool,
) -> [bool; LANES] {
    let mut changed = [false; LANES];
    for y in y.chunks_mut(FEW) {
        let mut few = [0.0; FEW];
        let values = &mut few[..y.len()];
        for ((lane, at), changed) in now.iter().enumerate().zip(&mut changed) {
            gather(y, lane, values);
            *changed |= readout(at, values);
            for (y, value) in y.iter_mut().zip(&*values) {
                y.0[lane] = *value;
            }
        }
    }
    changed
}

/// Puts outputs, `p` each, through the readout; returns whether it changed any.
#[inline(always)]
pub(super) fn readout_one_by_one(p: usize, y: &mut [f64], readout: impl Fn(&mut [f64])) -> bool {
    let mut changed = false;
    for y in y.chunks_exact_mut(p) {
        changed |= changes(y, &readout);
    }
    changed
}

/// Runs `with` and tells whether it changed `values`. Nothing is left of this for a `with` that does nothing.
#[inline(always)]
fn changes(values: &mut [f64], with: impl FnOnce(&mut [f64])) -> bool {
    let (mut few, many);
    let before = if values.len() <= FEW {
        few = [0.0; FEW];
        few[..values.len()].copy_from_slice(values);
        &few[..values.len()]
    } else {
        many = values.to_vec();
        &many
    };
    with(values);
    differ(values, before)
}
