//! One pass of the filter over its record, row by row.

use super::gaussian::{Belief, Columns, Root, regular};
use super::likelihood::{LOG_TWO_PI, LogLikelihood};
use super::moments::Moments;
use super::order::Order;
use super::size::{Numbers, Size};
use super::update::{Measured, Update};
use super::{FilterError, Kalman};
use crate::twin::{Acting, Now, Outliers};

/// Innovation of one row.
pub(super) struct Innovation<'w> {
    /// Outputs given the rows before.
    pub predicted: &'w [f64],
    pub innovation: &'w [f64],
    /// p × p.
    pub covariance: &'w [f64],
    pub standardised: &'w [f64],
    /// The row of the record; NaN where an output is missing, and so has no density.
    measured: &'w [f64],
    /// Variance of each output given those before it.
    pivots: &'w [f64],
    /// Nats by which the density exceeds a normal one.
    excess: f64,
    order: &'w Order<'w>,
    row: usize,
}

impl Innovation<'_> {
    /// Sample at which the record has output j, if it has it.
    pub fn sample_of(&self, j: usize) -> Option<usize> {
        self.order.sample_of(self.row, j)
    }

    /// log p(y_k | y_0 … y_{k−1}), in nats.
    pub fn log_density(&self) -> f64 {
        let values = (self.standardised.iter().zip(self.pivots)).zip(self.measured);
        let sum: f64 = values
            .filter(|(_, y)| !y.is_nan())
            .map(|((e, pivot), _)| LOG_TWO_PI + pivot.ln() + e * e)
            .sum();
        self.excess - 0.5 * sum
    }
}

/// Receiver of the results of a pass. Results that it does not need are not computed.
pub(super) trait Sink {
    /// Returns `true` if [`carried`](Self::carried) is wanted.
    #[inline(always)]
    fn wants_carried(&self) -> bool {
        false
    }
    /// Takes that of row i in the [`Order`] of the filter.
    fn innovation(&mut self, _i: usize, _of: &Innovation<'_>) {}
    /// State given rows up to k.
    fn filtered(&mut self, _k: usize, _state: Belief<'_>) {}
    /// State of row k + 1 given rows up to k, and cov(x_k, x_{k+1}).
    fn carried(&mut self, _k: usize, _next: Belief<'_>, _cross: &[f64]) {}
}

impl Sink for () {}

/// The state given the rows so far; apart from the buffers, of which calls to the twin see some, so that it can stay in registers.
struct State<S: Size> {
    mean: S::Vector,
    cov: S::Matrix,
}

impl<S: Size> State<S> {
    #[inline(always)]
    fn zero(n: usize) -> Self {
        Self {
            mean: S::Vector::zeros(n),
            cov: S::Matrix::zeros(n * n),
        }
    }

    #[inline(always)]
    fn slices(&mut self, n: usize) -> (&mut [f64], &mut [f64]) {
        (
            &mut self.mean.as_mut()[..n],
            &mut self.cov.as_mut()[..n * n],
        )
    }

    #[inline(always)]
    fn set(&mut self, to: Belief<'_>) {
        let (mean, cov) = self.slices(to.mean.len());
        mean.copy_from_slice(to.mean);
        cov.copy_from_slice(to.cov);
    }

    #[inline(always)]
    fn belief(&self, n: usize) -> Belief<'_> {
        Belief {
            mean: &self.mean.as_ref()[..n],
            cov: &self.cov.as_ref()[..n * n],
        }
    }
}

/// Twin, record and θ that a pass runs over.
pub(super) struct Bound<'k> {
    pub kalman: &'k Kalman<'k>,
    pub acting: &'k Acting<'k>,
    pub order: &'k Order<'k>,
    pub theta: &'k [f64],
}

/// The filter at one θ: buffers, and the likelihood of the rows so far.
pub(super) struct Pass<'k, S: Size> {
    size: S,
    kalman: &'k Kalman<'k>,
    acting: &'k Acting<'k>,
    order: &'k Order<'k>,
    now: Now<'k>,
    root: Root<S::Matrix>,
    moments: Moments<'k, S>,
    update: Update<S>,
    /// Standard deviations of process and measurement noise.
    q: S::Vector,
    r: S::Vector,
    predicted: S::Vector,
    scale: S::Vector,
    copy: State<S>,
    floor: S::Vector,
    rounding: Vec<f64>,
    outliers: Vec<Outliers>,
    likelihood: LogLikelihood,
}

impl<'k, S: Size> Pass<'k, S> {
    pub fn new(size: S, on: &'k Bound<'k>) -> Self {
        let Bound {
            kalman,
            acting,
            order,
            theta,
        } = on;
        let (n, p) = (size.states(), size.outputs());
        let (twin, method) = (kalman.twin, kalman.settings.method);
        let rounding = twin.rounding(theta);
        let mut floor = S::Vector::zeros(p);
        for j in 0..p {
            let rounds = rounding.get(j).is_some_and(|step| *step > 0.0);
            floor.as_mut()[j] = match rounds {
                true => kalman.floor[j],
                false => kalman.unrounded[j],
            };
        }
        Self {
            size,
            kalman,
            acting,
            order,
            now: acting.at(0, theta),
            root: Root::new(n),
            copy: State::zero(n),
            moments: Moments::new(size, twin, method, &kalman.limits),
            update: Update::new(size),
            q: S::Vector::zeros(n),
            r: S::Vector::zeros(p),
            predicted: S::Vector::zeros(p),
            scale: S::Vector::zeros(n),
            floor,
            rounding,
            outliers: twin.outliers(theta),
            likelihood: LogLikelihood::NONE,
        }
    }

    /// Over the whole record; the log-likelihood.
    pub fn run<K: Sink + ?Sized>(mut self, sink: &mut K) -> Result<f64, FilterError> {
        let mut state = self.start();
        let last = self.order.rows() - 1;
        for i in 0..last {
            self.measure(i, &mut state, sink)?;
            if i >= self.order.before {
                self.carry(i - self.order.before, &mut state, sink);
            }
        }
        self.measure(last, &mut state, sink)?;
        Ok(self.likelihood.total())
    }

    /// From the state given rows up to `from`, or from the start, through rows before `to`.
    pub fn run_from<K: Sink + ?Sized>(
        mut self,
        from: Option<(usize, Belief<'_>)>,
        to: usize,
        sink: &mut K,
    ) -> Result<(), FilterError> {
        let (first, mut state) = match from {
            Some((k, belief)) => {
                let mut state = State::zero(self.size.states());
                state.set(belief);
                self.now = self.acting.at(k, self.now.theta);
                self.noise();
                self.carry(k, &mut state, sink);
                (k + 1, state)
            }
            None => (0, self.start()),
        };
        for k in first..to {
            self.measure(k, &mut state, sink)?;
            self.carry(k, &mut state, sink);
        }
        Ok(())
    }

    /// The first state.
    fn start(&mut self) -> State<S> {
        let n = self.size.states();
        // In the copy: what a call has seen leaves the registers.
        let (mean, cov) = self.copy.slices(n);
        (self.kalman).start(&self.now, mean, cov, self.scale.as_mut());
        let mut state = State::zero(n);
        state.set(self.copy.belief(n));
        state
    }

    /// Noise levels of this row.
    #[inline(always)]
    fn noise(&mut self) {
        let (n, p) = (self.size.states(), self.size.outputs());
        let (q, r) = (&mut self.q.as_mut()[..n], &mut self.r.as_mut()[..p]);
        q.fill(0.0);
        r.fill(0.0);
        self.kalman.twin.noise(&self.now, q, r);
    }

    /// Puts row i into the state.
    #[inline(always)]
    fn measure<K: Sink + ?Sized>(
        &mut self,
        i: usize,
        state: &mut State<S>,
        sink: &mut K,
    ) -> Result<(), FilterError> {
        let (n, p) = (self.size.states(), self.size.outputs());
        let k = self.order.state_of(i);
        self.now = self.acting.at(k, self.now.theta);
        self.noise();
        let told = match self.regular(state) {
            Some(columns) => self.tell(i, state, Columns::all(n, columns.as_ref())),
            None => {
                let root = self.singular(state);
                let told = self.tell(i, state, root.columns());
                self.root = root;
                told
            }
        };
        if told.is_none() {
            return Err(self.lost(state));
        }
        if !self.likelihood.is_finite() {
            return Err(FilterError::Diverged { at: self.now.t });
        }
        sink.innovation(
            i,
            &Innovation {
                predicted: &self.predicted.as_ref()[..p],
                innovation: &self.update.innovation.as_ref()[..p],
                covariance: &self.update.covariance.as_ref()[..p * p],
                standardised: &self.update.standardised.as_ref()[..p],
                measured: self.order.row(i),
                pivots: &self.update.pivots.as_ref()[..p],
                excess: self.update.excess,
                order: self.order,
                row: i,
            },
        );
        if i >= self.order.before {
            sink.filtered(k, state.belief(n));
        }
        Ok(())
    }

    #[inline(always)]
    fn tell(&mut self, i: usize, state: &mut State<S>, root: Columns<'_>) -> Option<()> {
        let (n, p) = (self.size.states(), self.size.outputs());
        let (mean, cov) = state.slices(n);
        let predicted = &mut self.predicted.as_mut()[..p];
        let outputs = (self.moments).observe(&self.now, mean, root, predicted);
        let row = Measured {
            y: self.order.row(i),
            predicted,
            noise: &self.r.as_ref()[..p],
            floor: &self.floor.as_ref()[..p],
            rounding: &self.rounding,
            outliers: &self.outliers,
        };
        let (at, state) = ((self.kalman.twin, &self.now), (mean, cov));
        if self.order.gaps && row.y.iter().any(|y| y.is_nan()) {
            let likelihood = &mut self.likelihood;
            return (self.update).apply_present(at, &row, root, outputs, state, likelihood);
        }
        (self.update).apply(at, &row, root, outputs, state, &mut self.likelihood)
    }

    /// Carries the state from row k to the next.
    #[inline(always)]
    fn carry<K: Sink + ?Sized>(&mut self, k: usize, state: &mut State<S>, sink: &mut K) {
        match self.regular(state) {
            Some(columns) => {
                let all = Columns::all(self.size.states(), columns.as_ref());
                self.predict(k, state, all, sink);
            }
            None => {
                let root = self.singular(state);
                self.predict(k, state, root.columns(), sink);
                self.root = root;
            }
        }
    }

    #[inline(always)]
    fn predict<K: Sink + ?Sized>(
        &mut self,
        k: usize,
        state: &mut State<S>,
        root: Columns<'_>,
        sink: &mut K,
    ) {
        let n = self.size.states();
        let (mean, cov) = state.slices(n);
        (self.moments).predict(&self.now, self.q.as_ref(), root, (mean, cov));
        let scale = &mut self.scale.as_mut()[..n];
        let felt = self.kalman.hold(mean, cov, scale);
        if sink.wants_carried() {
            let mut cross = vec![0.0; n * n];
            self.moments.cross(root, &mut cross);
            if felt {
                for row in cross.chunks_exact_mut(n) {
                    for (c, scale) in row.iter_mut().zip(&*scale) {
                        *c *= scale;
                    }
                }
            }
            sink.carried(k, state.belief(n), &cross);
        }
    }

    /// Cholesky's columns of the covariance where all its pivots count, as they mostly do. What follows is compiled for
    /// this rank apart, and finds the columns in registers.
    #[inline(always)]
    fn regular(&self, state: &State<S>) -> Option<S::Matrix> {
        let n = self.size.states();
        if !S::KNOWN {
            return None;
        }
        let mut columns = S::Matrix::zeros(n * n);
        let Belief { mean, cov } = state.belief(n);
        regular(mean, cov, columns.as_mut()).then_some(columns)
    }

    /// The root of any covariance; to be put back.
    #[inline(always)]
    fn singular(&mut self, state: &State<S>) -> Root<S::Matrix> {
        let n = self.size.states();
        // Of a copy: what a call has seen leaves the registers.
        self.copy.set(state.belief(n));
        let Belief { mean, cov } = self.copy.belief(n);
        let mut root = std::mem::replace(&mut self.root, Root::new(0));
        root.factor(mean, cov);
        root
    }

    #[inline(always)]
    fn lost(&self, state: &State<S>) -> FilterError {
        let at = self.now.t;
        let (n, p) = (self.size.states(), self.size.outputs());
        let covariance = &self.update.covariance.as_ref()[..p * p];
        let mut finite = covariance.iter().all(|v| v.is_finite());
        for v in state.belief(n).mean {
            finite &= v.is_finite();
        }
        if finite {
            FilterError::NoSpread { at }
        } else {
            FilterError::Diverged { at }
        }
    }
}
