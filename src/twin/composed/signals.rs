//! Outputs, starts and inputs of composed equations.

use super::parts::{Added, Theta};
use super::{
    Acting, Composed, Disturbance, Entry, Law, LawPart, LawPlace, Seen, SignalChange, TwinPart,
};
use crate::record::{Drive, RecordError, Signal};
use crate::twin::points::Layout;
use crate::twin::{Hold, Now, SimulationError, Workspace};
use smallvec::SmallVec;

/// Outputs of points that are kept on the stack.
const SHORT: usize = 16;

impl Composed {
    /// Sets `y` to the outputs of the states `x` without noise, of one point or of several side by side.
    pub fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.resolved(now, |now| {
            self.own_outputs(now, x, y);
            // Memories advance in `update`, once a sample; looking changes nothing.
            if self.parts.acts.on_outputs {
                for added in &self.parts.list {
                    self.look(added, now, x, y);
                }
            }
        });
    }

    /// Changes outputs of points by a part, its memory left as it is.
    #[inline]
    fn look(&self, added: &Added, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        let (n, p) = (self.states(), self.outputs());
        match &added.part {
            TwinPart::Law(part) => {
                if let Law::Sensor(law) = &part.law {
                    let at = self.parts.behind(now, added.delays);
                    let on = part.place(&added.states);
                    part.magnitudes(now, |m| {
                        law.peek(m, &at, &on, (Layout::dense(n), x), (p, y));
                    });
                }
            }
            TwinPart::Disturbance(part) => {
                if let Entry::Sensor(target) = part.entry {
                    for (x, y) in x.chunks_exact(n).zip(y.chunks_exact_mut(p)) {
                        y[target] += x[added.states.start];
                    }
                }
            }
            TwinPart::Unit(factor) => y.iter_mut().for_each(|y| *y *= factor),
            _ => {}
        }
    }

    /// Number of outputs.
    #[inline]
    pub(super) fn outputs(&self) -> usize {
        self.parts.outline.outputs.len()
    }

    fn own_outputs(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        let (n, p) = (self.states(), self.outputs());
        let at = Layout {
            states: self.parts.states,
            stride: n,
        };
        if !self.parts.acts.by_states {
            return self.inside(now, None, |own| self.own.observe_points(own, at, p, x, y));
        }
        for (x, y) in x.chunks_exact(n).zip(y.chunks_exact_mut(p)) {
            self.inside(now, Some(x), |own| {
                self.own.observe_points(own, at, p, x, y)
            });
        }
    }

    /// Advances the memories of sensors, so many points at once that their outputs need no heap.
    pub(super) fn remember_signals(&self, now: &Now<'_>, x: &mut [f64]) {
        let (n, p) = (self.states(), self.outputs());
        let mut y = SmallVec::<[f64; SHORT]>::from_elem(0.0, SHORT.max(p));
        for x in x.chunks_mut(SHORT / p.min(SHORT) * n) {
            let y = &mut y[..x.len() / n * p];
            self.own_outputs(now, x, y);
            for added in &self.parts.list {
                match &added.part {
                    TwinPart::Law(part) if self.parts.moves(now, added.delays) => {
                        if let Law::Sensor(law) = &part.law {
                            let at = self.parts.behind(now, added.delays);
                            let on = part.place(&added.states);
                            part.magnitudes(now, |m| {
                                law.pass(m, &at, &on, (Layout::dense(n), x), (p, y));
                            });
                        }
                    }
                    _ => self.look(added, now, x, y),
                }
            }
        }
    }

    /// Changes outputs, of one point or of several, behind their noise; returns whether any changed.
    pub(crate) fn readout(&self, now: &Now<'_>, y: &mut [f64]) -> bool {
        self.resolved(now, |now| {
            let p = self.outputs();
            if !self.parts.acts.on_readings {
                return self.inside(now, None, |own| self.own.readout_points(own, p, y));
            }
            for added in &self.parts.list {
                if let TwinPart::Unit(factor) = added.part {
                    y.iter_mut().for_each(|y| *y /= factor);
                }
            }
            let mut changed = self.inside(now, None, |own| self.own.readout_points(own, p, y));
            for added in &self.parts.list {
                match &added.part {
                    TwinPart::Unit(factor) => y.iter_mut().for_each(|y| *y *= factor),
                    TwinPart::Law(part) => {
                        let Law::Reading(law) = &part.law else {
                            continue;
                        };
                        let (before, on) = (Theta::from_slice(y), part.place(&added.states));
                        let at = self.parts.behind(now, added.delays);
                        // Behind the noise nobody remembers.
                        let states = (Layout::dense(1), &[][..]);
                        law.peek(part.m(now.theta), &at, &on, states, (p, y));
                        changed |=
                            (before.iter().zip(&*y)).any(|(a, b)| a.to_bits() != b.to_bits());
                    }
                    _ => {}
                }
            }
            changed
        })
    }

    /// Sets `x` to the state at the first row, from the start on without noise.
    pub(crate) fn run_to_first_row(
        &self,
        acting: &Acting<'_>,
        work: &mut Workspace,
        x: &mut [f64],
    ) {
        self.start(&acting.start(), x);
        for i in 0..acting.steps_before() {
            let now = acting.before(i);
            self.step(&now, x, work);
            self.constrain(&now, x);
            for (x, limit) in x.iter_mut().zip(self.limits()) {
                *x = limit.clamp(*x);
            }
        }
    }

    /// Moves the memories of signals inside the twin.
    pub(super) fn follow(&self, now: &Now<'_>, x: &mut [f64]) {
        for x in x.chunks_exact_mut(self.states().max(1)) {
            for (added, part, follows) in self.parts.memories() {
                if self.parts.moves(now, added.delays) {
                    let value = self.seen(follows.of, now, x);
                    let memory = &mut x[added.states.clone()];
                    let dt = now.memory_step(matches!(follows.of, Seen::Input(_)));
                    (follows.by).next(part.m(now.theta), dt, value, memory);
                }
            }
        }
    }

    /// Value of a signal inside the twin, in one point.
    fn seen(&self, of: Seen, now: &Now<'_>, x: &[f64]) -> f64 {
        match of {
            Seen::State(i) => x[i],
            Seen::Input(i) => now.u[i],
            Seen::Output(j) => {
                let mut y = Theta::from_elem(0.0, self.outputs());
                self.own_outputs(now, x, &mut y);
                y[j]
            }
        }
    }

    /// Sets the state that a run begins with.
    pub fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.resolved(now, |now| {
            let (own, added) = x.split_at_mut(self.parts.states);
            own.fill(0.0);
            self.inside(now, None, |now| self.own.start(now, own));
            added.fill(0.0);
            for added in &self.parts.list {
                if let TwinPart::Start { state, mean, .. } = &added.part {
                    x[*state] = mean.value(now.theta);
                }
            }
            self.begin(now, x);
        });
    }

    /// Returns which states the user's code sets a start of; the others are silent.
    pub(crate) fn written_starts(&self, now: &Now<'_>) -> Vec<bool> {
        let mut x = vec![f64::NAN; self.parts.states];
        self.resolved(now, |now| {
            self.inside(now, None, |now| self.own.start(now, &mut x));
        });
        let mut written: Vec<bool> = x.iter().map(|x| !x.is_nan()).collect();
        written.resize(self.states(), true);
        written
    }

    /// Sets the states that follow from the others at the first sample: memories, to the first values of their signals.
    pub(crate) fn begin(&self, now: &Now<'_>, x: &mut [f64]) {
        if self.parts.acts.in_memories {
            self.resolved(now, |now| {
                for (added, _, follows) in self.parts.memories() {
                    let value = match follows.of {
                        Seen::Input(input) if self.is_amount(input) => 0.0,
                        of => self.seen(of, now, x),
                    };
                    follows.by.begin(value, &mut x[added.states.clone()]);
                }
            });
        }
        if !self.parts.acts.in_sensors {
            return;
        }
        self.resolved(now, |now| {
            let mut y = Theta::from_elem(0.0, self.outputs());
            self.own_outputs(now, x, &mut y);
            for added in &self.parts.list {
                if let TwinPart::Law(part) = &added.part
                    && part.follows.is_none()
                    && !added.states.is_empty()
                {
                    x[added.states.clone()].fill(y[part.target]);
                }
                self.look(added, now, x, &mut y);
            }
        });
    }

    /// Sets standard deviations of the first state; `std` comes zeroed.
    pub(crate) fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.resolved(now, |now| {
            let own = &mut std[..self.parts.states];
            self.inside(now, None, |now| self.own.start_deviation(now, own));
            for added in &self.parts.list {
                match &added.part {
                    TwinPart::Start {
                        state, std: own, ..
                    } => std[*state] = *own,
                    TwinPart::UncertainStart { state, std: own } if std[*state] == 0.0 => {
                        std[*state] = *own;
                    }
                    TwinPart::Disturbance(part) => {
                        let share = Disturbance::started(part.memory);
                        std[added.states.start] = share * now.theta[part.sigma];
                    }
                    _ => {}
                }
            }
        });
    }

    /// Returns whole samples by which each output shows late what [`observe`](Self::observe) says; empty where none is. A run holds the
    /// outputs back before their noise, the first ones in place of those before the start; a filter takes the record's values so much
    /// earlier.
    pub(crate) fn dead_time(&self, theta: &[f64], dt: f64) -> Vec<usize> {
        let mut all = vec![];
        for part in self.late_sensors() {
            all.resize(self.outputs(), 0);
            let theta = self.complete(theta);
            all[part.target] += whole_samples(part.m(&theta)[0], dt);
        }
        all
    }

    /// Returns the delay of each output in seconds; empty where none has one.
    pub(crate) fn delays(&self, theta: &[f64]) -> Vec<f64> {
        self.take_delays(&mut self.complete(theta))
    }

    /// Delays of sensors.
    fn late_sensors(&self) -> impl Iterator<Item = &LawPart> {
        let is_late = |part: &&LawPart| part.is_dead_time && matches!(part.law, Law::Sensor(_));
        self.parts.laws().filter(is_late)
    }

    /// Sets delays of sensors to zero in all of θ, and returns those of each output in seconds; empty where none has one.
    pub(super) fn take_delays(&self, theta: &mut [f64]) -> Vec<f64> {
        let mut all = vec![];
        for part in self.late_sensors() {
            all.resize(self.outputs(), 0.0);
            all[part.target] += std::mem::take(&mut theta[part.magnitudes.start]);
        }
        all
    }

    /// Returns the drive behind the actuators; `None` where inputs act as they are recorded. Inputs do not depend on states, so that
    /// filters need no states for what actuators remember.
    pub(crate) fn actuated(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<Drive>, SimulationError> {
        let mut acting: Option<Drive> = None;
        let theta = self.complete(theta);
        for added in self.parts.list.iter().rev() {
            let before = acting.as_ref().unwrap_or(drive);
            acting = Some(match &added.part {
                TwinPart::Law(part) => match &part.law {
                    Law::Actuator(law) => {
                        part.act(law.as_ref(), &theta, (before, self.is_amount(part.target)))?
                    }
                    _ => continue,
                },
                TwinPart::Late(_) => {
                    let are_held = self.holds().into_iter().map(|hold| hold == Hold::Zero);
                    let late = before.late(self.parts.delay(added.delays, &theta), are_held);
                    late.map_err(SimulationError::of)?
                }
                _ => continue,
            });
        }
        Ok(acting)
    }
}

impl LawPart {
    /// Calls `then` with its magnitudes; a dead time loses its whole samples.
    #[inline]
    fn magnitudes<R>(&self, now: &Now<'_>, then: impl FnOnce(&[f64]) -> R) -> R {
        let m = self.m(now.theta);
        match self.is_dead_time {
            true => {
                let whole = || whole_samples(m[0], now.dt) as f64 * now.dt;
                then(&[m[0] - now.read_after.unwrap_or_else(whole)])
            }
            false => then(m),
        }
    }

    /// Passes its channel of a whole signal through its law, amounts or what goes on between rows: of amounts there were none before the first.
    pub(super) fn pass(
        &self,
        law: &dyn SignalChange,
        theta: &[f64],
        drive: &Drive,
        (signal, is_amount): (&mut Signal, bool),
    ) {
        let of = signal.column(self.target);
        let late = match (self.is_dead_time, is_amount) {
            (true, true) => Some(drive.delayed_amounts(of, self.m(theta)[0])),
            (true, false) if !drive.is_uniform() => Some(drive.delayed(of, self.m(theta)[0])),
            _ => None,
        };
        if let Some(late) = late {
            return signal.column_mut(self.target).assign(&late);
        }
        let first = if is_amount { 0.0 } else { of[0] };
        let mut memory = vec![first; self.memory];
        let on = LawPlace {
            target: 0,
            other: None,
            memory: 0..self.memory,
        };
        let at = Layout::dense(self.memory.max(1));
        memory.resize(self.memory.max(1), 0.0);
        for (k, value) in signal.column_mut(self.target).iter_mut().enumerate() {
            let value = std::slice::from_mut(value);
            let mut now = Now::new(drive.time(k), drive.step(k), drive.input(k), &[]);
            now.since = drive.since(k);
            if drive.is_repeated(k) {
                // Memories advance once to the next time.
                now.dt = drive.dt();
                law.peek(self.m(theta), &now, &on, (at, &memory), (1, value));
                continue;
            }
            law.pass(self.m(theta), &now, &on, (at, &mut memory), (1, value));
        }
    }

    /// Returns the drive behind its law, which acts on amounts or on what goes on between rows.
    pub(super) fn act(
        &self,
        law: &dyn SignalChange,
        theta: &[f64],
        (drive, is_amount): (&Drive, bool),
    ) -> Result<Drive, SimulationError> {
        let mut inputs = drive.inputs().clone();
        self.pass(law, theta, drive, (&mut inputs, is_amount));
        drive.with_inputs(inputs).map_err(|error| match error {
            RecordError::NotFinite { sample, .. } => SimulationError::Diverged {
                at: drive.time(sample),
            },
            error => SimulationError::of(error),
        })
    }
}

/// Samples that a dead time reaches back at most.
pub(crate) const LONGEST_DEAD_TIME: usize = 63;

/// Whole samples of a dead time; what is left lies between 0.37 and 1.37 samples, or is all of a shorter one. Delays are often whole
/// numbers of samples: from there, the number does not change under the small steps of a derivative.
fn whole_samples(delay: f64, dt: f64) -> usize {
    (delay / dt - 0.37)
        .floor()
        .max(0.0)
        .min(LONGEST_DEAD_TIME as f64) as usize
}
