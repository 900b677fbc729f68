//! One pass of a filter over its record, row by row; or of several filters side by side.

mod sink;

use super::gaussian::{Belief, Columns, Root, regular};
use super::moments::{Moment, Moments};
use super::normal::clip::clip;
use super::number::FilterNumber;
use super::order::{Order, ShownState};
use super::size::{Any, Buffer, Size};
use super::update::{MeasuredRow, Readings, Update};
use super::{FilterError, Kalman};
use crate::math::{Condition, Number};
use crate::twin::{Acting, LanePlaces, LevelFactors, Now, SimulationError};
pub(super) use sink::{Innovation, Sink};
use std::ops::Range;

/// The state given the rows so far; apart from the buffers, of which calls to the twin see some, so that it can stay in registers.
struct FilterState<S: Size, N: Number> {
    mean: S::Vector<N>,
    cov: S::Matrix<N>,
}

impl<S: Size, N: Number> FilterState<S, N> {
    #[inline(always)]
    fn zero(n: usize) -> Self {
        Self {
            mean: S::Vector::zeros(n),
            cov: S::Matrix::zeros(n * n),
        }
    }

    #[inline(always)]
    fn slices(&mut self, n: usize) -> Moment<'_, N> {
        (
            &mut self.mean.numbers_mut()[..n],
            &mut self.cov.numbers_mut()[..n * n],
        )
    }

    #[inline(always)]
    fn set(&mut self, to: Belief<'_, N>) {
        let (mean, cov) = self.slices(to.mean.len());
        mean.copy_from_slice(to.mean);
        cov.copy_from_slice(to.cov);
    }

    #[inline(always)]
    fn belief(&self, n: usize) -> Belief<'_, N> {
        Belief {
            mean: &self.mean.numbers()[..n],
            cov: &self.cov.numbers()[..n * n],
        }
    }
}

/// A record that a filter runs over, at θ.
pub(super) struct FilterJob<'j> {
    pub kalman: &'j Kalman<'j>,
    pub order: Order<'j>,
    pub theta: &'j [f64],
    /// The record's drive as the twin sees it at θ.
    pub acting: Acting<'j>,
}

/// A filter of each job, one a lane: buffers, and the likelihood of the rows so far. The records of all jobs are of one twin, and have the
/// same rows missing.
pub(super) struct Pass<'k, S: Size, N: FilterNumber> {
    size: S,
    jobs: &'k [FilterJob<'k>],
    /// The first job's; so is the order.
    kalman: &'k Kalman<'k>,
    order: &'k Order<'k>,
    now: LanePlaces<'k>,
    factors: LevelFactors<N>,
    moments: Moments<'k, S, N>,
    update: Update<S, N>,
    /// Standard deviations of process and measurement noise.
    q: S::Vector<N>,
    r: S::Vector<N>,
    /// The row, and its prediction.
    y: S::Vector<N>,
    predicted: S::Vector<N>,
    scale: S::Vector<N>,
    copy: FilterState<S, N>,
    floor: S::Vector<N>,
    jitter: S::Vector<N>,
    readings: Vec<Readings>,
    /// The row to come, and the state given those before it.
    row: usize,
    state: FilterState<S, N>,
    /// Lanes in which the filter works.
    valid: N::Condition,
}

/// A pass of any size, which goes on in blocks of rows.
pub(super) trait AnyPass<N>: Send {
    /// Goes on through the rows before `end`.
    fn run_to(&mut self, end: usize, sink: &mut dyn Sink<N>) -> Result<(), FilterError>;

    /// log p of the rows so far, in nats; NaN in lanes that failed.
    fn log_likelihood(&self) -> N;
}

impl<S: Size> AnyPass<f64> for Pass<'_, S, f64> {
    fn run_to(&mut self, end: usize, sink: &mut dyn Sink) -> Result<(), FilterError> {
        Pass::run_to(self, end, sink)
    }

    fn log_likelihood(&self) -> f64 {
        Pass::log_likelihood(self)
    }
}

impl<'k, S: Size, N: FilterNumber> Pass<'k, S, N> {
    /// Before the first row.
    pub fn new(size: S, jobs: &'k [FilterJob<'k>]) -> Self {
        let mut pass = Self::prepared(size, jobs);
        pass.start();
        pass
    }

    /// Behind row k, the state given rows up to which is known.
    pub fn behind(
        size: S,
        jobs: &'k [FilterJob<'k>],
        (k, known): (usize, Belief<'_, N>),
        sink: &mut dyn Sink<N>,
    ) -> Self {
        let mut pass = Self::prepared(size, jobs);
        let n = size.states();
        let (mut root, mut state) = (Root::new(n), FilterState::zero(n));
        state.set(known);
        pass.go_to(k, &state);
        pass.go_on(k, &mut state, &mut root, sink);
        pass.row = k + 1;
        pass.state = state;
        pass
    }

    /// With all buffers, and without a state.
    fn prepared(size: S, jobs: &'k [FilterJob<'k>]) -> Self {
        let (n, p) = (size.states(), size.outputs());
        let FilterJob { kalman, order, .. } = &jobs[0];
        let readings: Vec<Option<Readings>> = (jobs.iter())
            .map(|job| Readings::of(&kalman.twin, job.theta))
            .collect();
        let by_output = |of: &dyn Fn(usize, usize) -> f64| {
            let mut values = S::Vector::zeros(p);
            for (j, value) in values.numbers_mut()[..p].iter_mut().enumerate() {
                *value = N::of_lanes(|lane| of(held_by(lane, jobs.len()), j));
            }
            values
        };
        let floor = by_output(
            &|i, j| match readings[i].as_ref().is_some_and(|r| r.rounds(j)) {
                true => jobs[i].kalman.floor[j],
                false => jobs[i].kalman.unrounded[j],
            },
        );
        let jitter = by_output(&|i, j| jobs[i].kalman.jitter[j]);
        let now: Vec<Now<'_>> = (jobs.iter()).map(|job| job.acting.at(0)).collect();
        let theta = |lane| now[held_by(lane, jobs.len())].theta;
        let factors = kalman.twin.level_factors(theta);
        let now = match N::LANES {
            1 => LanePlaces::of_one(now[0]),
            _ => LanePlaces::new(now, kalman.twin.own_parameters()),
        };
        Self {
            size,
            jobs,
            kalman,
            order,
            factors,
            now,
            copy: FilterState::zero(n),
            row: 0,
            state: FilterState::zero(n),
            moments: Moments::new(size, kalman),
            update: Update::new(size),
            q: S::Vector::zeros(n),
            r: S::Vector::zeros(p),
            y: S::Vector::zeros(p),
            predicted: S::Vector::zeros(p),
            scale: S::Vector::zeros(n),
            floor,
            jitter,
            readings: match readings.iter().any(Option::is_some) {
                true => readings
                    .into_iter()
                    .map(Option::unwrap_or_default)
                    .collect(),
                false => vec![],
            },
            valid: N::ZERO.below(N::all(1.0)),
        }
    }

    /// Goes on through the rows before `end`.
    #[inline(always)]
    pub fn run_to(&mut self, end: usize, sink: &mut dyn Sink<N>) -> Result<(), FilterError> {
        let n = self.size.states();
        let mut root = Root::new(n);
        // A copy: what a call has seen leaves the registers.
        let mut state = FilterState::zero(n);
        state.set(self.state.belief(n));
        for i in self.row..end {
            self.measure(i, &mut state, &mut root, sink)?;
            if i + 1 < self.order.rows() && self.order.is_last(i) {
                match self.order.place(i) {
                    ShownState::Sample(k) => self.go_on(k, &mut state, &mut root, sink),
                    ShownState::Before(step) => self.go_to_row(step, i + 1, &mut state),
                }
            }
        }
        self.state.set(state.belief(n));
        self.row = end;
        Ok(())
    }

    /// log p of the rows so far, in nats; NaN in lanes that failed.
    pub fn log_likelihood(&self) -> N {
        let total = self.update.likelihood.total();
        self.valid.select(total, N::all(f64::NAN))
    }

    fn start(&mut self) {
        let n = self.size.states();
        let (mut mean, mut cov, mut scale) = (vec![0.0; n], vec![0.0; n * n], vec![0.0; n]);
        let (means, covs) = self.state.slices(n);
        for lane in 0..N::LANES {
            let i = held_by(lane, self.jobs.len());
            mean.fill(0.0);
            cov.fill(0.0);
            let now = self.jobs[i].acting.start();
            (self.jobs[i].kalman).start(&now, &mut mean, &mut cov, &mut scale);
            let to = means.iter_mut().chain(&mut *covs);
            for (to, value) in to.zip(mean.iter().chain(&cov)) {
                *to.lane_mut(lane) = *value;
            }
        }
        if self.jobs[0].acting.steps_before() > 0 {
            let mut state = FilterState::zero(n);
            state.set(self.state.belief(n));
            self.go_to_row(0, 0, &mut state);
            self.state.set(state.belief(n));
        }
    }

    /// Carries the state from the start of this step before the first row to row i. Filters side by side have as many such steps.
    #[inline(always)]
    fn go_to_row(&self, step: usize, i: usize, state: &mut FilterState<S, N>) {
        let end = match self.order.place(i) {
            ShownState::Before(step) => step,
            ShownState::Sample(_) => self.jobs[0].acting.steps_before(),
        };
        if step == end {
            return;
        }
        let n = self.size.states();
        let any = Any {
            states: n,
            outputs: self.size.outputs(),
        };
        let mut carried = FilterState::zero(n);
        carried.set(state.belief(n));
        Pass::prepared(any, self.jobs).take_steps(step..end, &mut carried);
        state.set(carried.belief(n));
    }

    /// Inputs of sample k, and noise levels there at the mean of the state.
    #[inline(always)]
    fn go_to(&mut self, k: usize, state: &FilterState<S, N>) {
        let jobs = self.jobs;
        self.now.each(|lane, now| jobs[lane].acting.go_to(k, now));
        self.set_noise(state);
    }

    /// Inputs of a step before the first row, and noise levels there.
    #[cold]
    fn go_before(&mut self, step: usize, state: &FilterState<S, N>) {
        let jobs = self.jobs;
        (self.now).each(|lane, now| *now = jobs[lane].acting.before(step));
        self.set_noise(state);
    }

    /// Noise levels of the present step at the mean of the state.
    #[inline(always)]
    fn set_noise(&mut self, state: &FilterState<S, N>) {
        let (n, p) = (self.size.states(), self.size.outputs());
        let (q, r) = (
            &mut self.q.numbers_mut()[..n],
            &mut self.r.numbers_mut()[..p],
        );
        // Of a copy: what a call has seen leaves the registers.
        let x = &mut self.copy.mean.numbers_mut()[..n];
        x.copy_from_slice(state.belief(n).mean);
        let asked = (&self.kalman.twin, &mut self.now, &self.factors);
        N::noise(asked, x, q, r);
    }

    /// Puts row i into the state.
    #[inline(always)]
    fn measure(
        &mut self,
        i: usize,
        state: &mut FilterState<S, N>,
        root: &mut Root<S::Matrix<N>>,
        sink: &mut dyn Sink<N>,
    ) -> Result<(), FilterError> {
        let (n, p) = (self.size.states(), self.size.outputs());
        let place = self.order.place(i);
        match place {
            ShownState::Sample(k) => self.go_to(k, state),
            ShownState::Before(step) => self.go_before(step, state),
        }
        if let Some(time) = self.order.read_after(i) {
            self.now.each(|_, now| now.read_after = Some(time));
        }
        for (j, y) in self.y.numbers_mut()[..p].iter_mut().enumerate() {
            *y = N::of_lanes(|lane| {
                let job = &self.jobs[held_by(lane, self.jobs.len())];
                job.order.row(i)[j]
            });
        }
        let good = match self.regular(state) {
            Some(columns) => self.update_state(state, Columns::all(n, columns.numbers())),
            None => {
                self.factor(state, root);
                self.update_state(state, root.columns())
            }
        };
        let is_finite = self.update.likelihood.is_finite();
        let before = self.valid & good;
        self.valid = before & is_finite;
        if !self.valid.any() {
            return Err(match before.any() && self.moments.fault().is_none() {
                true => FilterError::Diverged {
                    at: self.now.whole()[0].t,
                },
                false => self.failure(state),
            });
        }
        sink.innovation(
            i,
            &Innovation {
                predicted: &self.predicted.numbers()[..p],
                innovation: &self.update.innovation.numbers()[..p],
                covariance: &self.update.covariance.numbers()[..p * p],
                plain: (self.update.plain.each_ref()).map(|of| &of.numbers()[..p]),
                standardised: &self.update.standardised.numbers()[..p],
                measured: &self.y.numbers()[..p],
                pivots: &self.update.pivots.numbers()[..p],
                excess: self.update.excess,
                order: self.order,
                row: i,
            },
        );
        if let ShownState::Sample(k) = place
            && self.order.is_last(i)
        {
            sink.filtered(k, state.belief(n));
        }
        Ok(())
    }

    #[inline(always)]
    fn update_state(
        &mut self,
        state: &mut FilterState<S, N>,
        root: Columns<'_, N>,
    ) -> N::Condition {
        let (n, p) = (self.size.states(), self.size.outputs());
        let (mean, cov) = state.slices(n);
        let predicted = &mut self.predicted.numbers_mut()[..p];
        let outputs = (self.moments).observe(&self.now, mean, root, predicted);
        let row = MeasuredRow {
            at: (&self.kalman.twin, &self.now),
            y: &self.y.numbers()[..p],
            predicted,
            noise: &self.r.numbers()[..p],
            floor: &self.floor.numbers()[..p],
            jitter: &self.jitter.numbers()[..p],
            readings: &self.readings,
        };
        if self.order.gaps && row.y.iter().any(|y| y.lane(0).is_nan()) {
            return (self.update).apply_present(&row, root, outputs, (mean, cov));
        }
        (self.update).apply(&row, root, outputs, (mean, cov))
    }

    /// Carries the state from row k to the next, unless that is another reading of it. Filters side by side have the same replicates.
    #[inline(always)]
    fn go_on(
        &mut self,
        k: usize,
        state: &mut FilterState<S, N>,
        root: &mut Root<S::Matrix<N>>,
        sink: &mut dyn Sink<N>,
    ) {
        if !self.jobs[0].acting.stands(k) {
            return self.carry(k, state, root, sink);
        }
        if sink.wants_carried() {
            let belief = state.belief(self.size.states());
            sink.carried(k, belief, belief.cov);
        }
    }

    /// Carries the state from row k to the next.
    #[inline(always)]
    fn carry(
        &mut self,
        k: usize,
        state: &mut FilterState<S, N>,
        root: &mut Root<S::Matrix<N>>,
        sink: &mut dyn Sink<N>,
    ) {
        let n = self.size.states();
        match self.regular(state) {
            Some(columns) => {
                let all = Columns::all(n, columns.numbers());
                self.predict(k, state, all, sink);
            }
            None => {
                self.factor(state, root);
                self.predict(k, state, root.columns(), sink);
            }
        }
    }

    #[inline(always)]
    fn predict(
        &mut self,
        k: usize,
        state: &mut FilterState<S, N>,
        root: Columns<'_, N>,
        sink: &mut dyn Sink<N>,
    ) {
        let n = self.size.states();
        let (mean, cov) = state.slices(n);
        (self.moments).predict(&self.now, self.q.numbers(), root, (mean, cov));
        let scale = &mut self.scale.numbers_mut()[..n];
        let felt = clip(mean, cov, &self.kalman.limits, scale);
        if sink.wants_carried() {
            let mut cross = vec![N::ZERO; n * n];
            self.moments.cross(root, &mut cross);
            if felt {
                for row in cross.chunks_exact_mut(n) {
                    for (c, scale) in row.iter_mut().zip(&*scale) {
                        *c = *c * *scale;
                    }
                }
            }
            sink.carried(k, state.belief(n), &cross);
        }
    }

    /// Cholesky's columns of the covariance where all its pivots count, as they mostly do. What follows is compiled for
    /// this rank apart, and finds the columns in registers. Lanes would change bits of each other.
    #[inline(always)]
    fn regular(&self, state: &FilterState<S, N>) -> Option<S::Matrix<N>> {
        let n = self.size.states();
        if !S::KNOWN || N::LANES > 1 {
            return None;
        }
        let mut columns = S::Matrix::zeros(n * n);
        let Belief { mean, cov } = state.belief(n);
        regular(mean, cov, columns.numbers_mut()).then_some(columns)
    }

    /// The root of any covariance.
    #[inline(always)]
    fn factor(&mut self, state: &FilterState<S, N>, root: &mut Root<S::Matrix<N>>) {
        let n = self.size.states();
        let mut at = state.belief(n);
        if N::LANES == 1 {
            // Of a copy: what a call has seen leaves the registers.
            self.copy.set(at);
            at = self.copy.belief(n);
        }
        root.factor(at.mean, at.cov);
    }

    #[inline(always)]
    fn failure(&self, state: &FilterState<S, N>) -> FilterError {
        let at = self.now.whole()[0].t;
        if let Some(fault) = self.moments.fault() {
            return FilterError::Simulation(SimulationError::Failed(fault.into()));
        }
        let (n, p) = (self.size.states(), self.size.outputs());
        let covariance = &self.update.covariance.numbers()[..p * p];
        let mut finite = covariance.iter().all(|v| v.lane(0).is_finite());
        for v in state.belief(n).mean {
            finite &= v.lane(0).is_finite();
        }
        if finite {
            FilterError::NoSpread { at }
        } else {
            FilterError::Diverged { at }
        }
    }
}

impl<N: FilterNumber> Pass<'_, Any, N> {
    /// Carries the state over steps before the first row. Compiled for no size of its own: these are few.
    #[cold]
    fn take_steps(mut self, steps: Range<usize>, state: &mut FilterState<Any, N>) {
        let mut root = Root::new(self.size.states());
        for step in steps {
            self.go_before(step, state);
            self.carry(0, state, &mut root, &mut ());
        }
    }
}

/// The job of a lane; lanes without one repeat the first.
#[inline(always)]
fn held_by(lane: usize, jobs: usize) -> usize {
    if lane < jobs { lane } else { 0 }
}
