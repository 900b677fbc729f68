//! Equations whose rates or outputs a program computes, for all points of a call in one exchange.

use super::asking::Asker;
use super::frame::PointTable;
use super::inside::{Inside, ServedMethod};
use super::running::locked;
use super::shared::{Exchanges, PointsAsked};
use crate::equations::Program;
use crate::math::Lanes;
use crate::setting::number;
use crate::twin::{
    Blocks, Composed, Integrator, Interval, Layout, Now, Outline, SimulationError, StateSpace,
    Stepping,
};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

/// Passes that are under way at once, so that their points share exchanges: a thread that waits for each. An exchange costs some 0.1 ms
/// whatever it carries, and a pass some 5 µs of it to be woken: half as many passes nearly double the cost of each, twice as many save a
/// tenth where so many are asked for at once.
const BESIDE: usize = 64;

/// Equations of a program: a text but for what the program serves.
pub(super) struct ServedEquations {
    asker: Arc<Asker>,
    exchanges: Exchanges,
    /// Starts, noise, limits, and what is not served.
    text: Arc<Program>,
    /// Served rates, or next states.
    motion: Option<ServedMethod>,
    serves_outputs: bool,
    sizes: Sizes,
    /// Why the last runs that failed did, with their θ.
    faults: Mutex<VecDeque<(Vec<f64>, SimulationError)>>,
}

/// Numbers of states and outputs.
#[derive(Clone, Copy)]
struct Sizes {
    states: usize,
    outputs: usize,
}

impl ServedEquations {
    /// The equations of a description, asked of its program.
    pub fn new(asker: Arc<Asker>, inside: &Inside) -> Self {
        let text = inside.equations.program();
        let outline = text.outline();
        Self {
            exchanges: Exchanges::new(asker.clone()),
            asker,
            text,
            motion: (inside.serves.iter().copied()).find(|method| *method != ServedMethod::Observe),
            serves_outputs: inside.serves.contains(&ServedMethod::Observe),
            sizes: Sizes {
                states: outline.states.len(),
                outputs: outline.outputs.len(),
            },
            faults: Mutex::default(),
        }
    }

    /// Returns them as twins are held.
    pub fn composed(self: &Arc<Self>, inside: &Inside) -> Composed {
        inside
            .equations
            .composed_of(self.clone())
            .asked_beside(BESIDE)
    }

    /// Asks for what a method computes at points: rows of numbers, one a point; `None` where the program gives none.
    fn ask(&self, method: ServedMethod, now: &Now<'_>, table: PointTable) -> Option<Vec<f64>> {
        match self.answer(method, now, table) {
            Ok(numbers) => Some(numbers),
            Err(error) => {
                let mut faults = locked(&self.faults);
                // Of as many passes as are under way, twice over.
                faults.truncate(2 * BESIDE);
                faults.push_front((now.theta.to_vec(), error));
                None
            }
        }
    }

    fn answer(
        &self,
        method: ServedMethod,
        now: &Now<'_>,
        table: PointTable,
    ) -> Result<Vec<f64>, SimulationError> {
        let asker = &self.asker;
        asker.health.check()?;
        let points = table.points();
        let question = Arc::new(PointsAsked {
            method,
            rows: match method {
                ServedMethod::Observe => self.sizes.outputs,
                ServedMethod::Drift | ServedMethod::Next => self.sizes.states,
            },
            table,
            theta: now.theta.to_vec(),
        });
        let numbers = self.exchanges.ask(&question)?;
        let table = &question.table;
        // The first point is the centre: others may be where no state ever is.
        let first = numbers.iter().step_by(points);
        let Some(row) = first.clone().position(|value| !value.is_finite()) else {
            asker.health.worked();
            return Ok(numbers);
        };
        let value = numbers[row * points];
        let [t, u, theta, x] = table.point(0);
        let is_whole = [&t, &u, &theta, &x]
            .iter()
            .all(|all| all.iter().all(|v| v.is_finite()));
        if !is_whole {
            return Ok(numbers);
        }
        let text = self.odd(method, (row, value), &[t, x]);
        Err(asker.health.failed(now.theta, text))
    }

    /// Says where a method has a value that is not finite.
    fn odd(
        &self,
        method: ServedMethod,
        (row, value): (usize, f64),
        [t, x]: &[Vec<f64>; 2],
    ) -> String {
        let outline = self.text.outline();
        let of = match method {
            ServedMethod::Observe => &outline.outputs,
            ServedMethod::Drift | ServedMethod::Next => &outline.states,
        };
        let states = (outline.states.iter().zip(x).take(4))
            .map(|(state, x)| format!("{} = {}", state.name, number(*x)))
            .collect::<Vec<_>>();
        let at = format!("t = {} s, {}", number(t[0]), states.join(", "));
        let (method, name) = (method.name(), &of[row].name);
        self.asker.named(&format!(
            "answered {method} with {value} for {name} at {at}; give finite numbers there, or shrink the bounds"
        ))
    }

    /// The table of points side by side, `stride` numbers from one to the next.
    fn table(&self, now: &Now<'_>, stride: usize, x: &[f64]) -> PointTable {
        let mut table = PointTable::new(x.len() / stride, now, self.sizes.states);
        for (point, x) in x.chunks_exact(stride).enumerate() {
            table.put(point, now, |state| x[state]);
        }
        table
    }

    /// The table of the points of several filters, one lane after the other.
    fn table_of_lanes(&self, now: &[Now<'_>], x: &[Lanes]) -> PointTable {
        let n = self.sizes.states;
        let points = x.len() / n;
        let mut table = PointTable::new(points * now.len(), &now[0], n);
        for (lane, now) in now.iter().enumerate() {
            for (point, x) in x.chunks_exact(n).enumerate() {
                table.put(lane * points + point, now, |state| x[state].0[lane]);
            }
        }
        table
    }
}

/// Sets numbers of points from rows of an answer; not a number where there is none.
fn set(rows: Option<&[f64]>, count: usize, stride: usize, to: &mut [f64]) {
    let points = to.len() / stride;
    for (point, to) in to.chunks_exact_mut(stride).enumerate() {
        for (row, to) in to[..count].iter_mut().enumerate() {
            *to = rows.map_or(f64::NAN, |rows| rows[row * points + point]);
        }
    }
}

impl StateSpace for ServedEquations {
    fn outline(&self) -> Outline {
        self.text.outline()
    }

    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        Blocks::drift(self, now, x.len(), x, dx);
    }

    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        Blocks::observe(self, now, x.len(), x, y);
    }

    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.text.start(now, x);
    }

    fn start_deviation(&self, now: &Now<'_>, std: &mut [f64]) {
        self.text.start_deviation(now, std);
    }

    fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        self.text.noise(now, x, process, measurement);
    }

    fn limits(&self) -> Vec<Interval> {
        self.text.limits()
    }

    fn constrain(&self, now: &Now<'_>, x: &mut [f64]) {
        self.text.constrain(now, x);
    }

    fn limits_at(&self, now: &Now<'_>) -> Option<Vec<Interval>> {
        self.text.limits_at(now)
    }

    fn jumps(&self, now: &Now<'_>) -> Option<Vec<f64>> {
        self.text.jumps(now).filter(|_| self.motion.is_none())
    }

    fn check_parameters(&self, _: &[f64], _: f64) -> Result<(), SimulationError> {
        self.asker.health.check()
    }

    fn integrator(&self) -> Integrator {
        self.text.integrator()
    }

    fn stepping(&self) -> Stepping {
        self.text.stepping()
    }
}

impl Blocks for ServedEquations {
    fn drift(&self, now: &Now<'_>, stride: usize, x: &[f64], dx: &mut [f64]) {
        let Some(method) = self.motion else {
            return Blocks::drift(&*self.text, now, stride, x, dx);
        };
        let rows = self.ask(method, now, self.table(now, stride, x));
        set(rows.as_deref(), self.sizes.states, stride, dx);
    }

    fn observe(&self, now: &Now<'_>, stride: usize, x: &[f64], y: &mut [f64]) {
        if !self.serves_outputs {
            return Blocks::observe(&*self.text, now, stride, x, y);
        }
        let rows = self.ask(ServedMethod::Observe, now, self.table(now, stride, x));
        set(rows.as_deref(), self.sizes.outputs, self.sizes.outputs, y);
    }

    fn step_lanes(&self, now: &[Now<'_>], x: &mut [Lanes]) {
        let Some(method) = self.motion else {
            return self.text.step_lanes(now, x);
        };
        let n = self.sizes.states;
        let rows = self.ask(method, &now[0], self.table_of_lanes(now, x));
        let (points, passes) = (x.len() / n, now.len());
        for (lane, now) in now.iter().enumerate() {
            for (point, x) in x.chunks_exact_mut(n).enumerate() {
                for (state, x) in x.iter_mut().enumerate() {
                    let at = (state * passes + lane) * points + point;
                    let value = rows.as_ref().map_or(f64::NAN, |rows| rows[at]);
                    let x = &mut x.0[lane];
                    // As a discrete twin that is called point after point.
                    *x += match method {
                        ServedMethod::Next => now.dt * ((value - *x) / now.dt),
                        _ => now.dt * value,
                    };
                }
            }
        }
        idle_as_first(now.len(), x);
    }

    fn observe_lanes(&self, now: &[Now<'_>], x: &[Lanes], y: &mut [Lanes]) {
        if !self.serves_outputs {
            return self.text.observe_lanes(now, x, y);
        }
        let table = self.table_of_lanes(now, x);
        let rows = self.ask(ServedMethod::Observe, &now[0], table);
        let points = y.len();
        for lane in 0..now.len() {
            for (point, y) in y.iter_mut().enumerate() {
                let at = lane * points + point;
                y.0[lane] = rows.as_ref().map_or(f64::NAN, |rows| rows[at]);
            }
        }
        idle_as_first(now.len(), y);
    }

    fn is_joined(&self) -> bool {
        self.motion == Some(ServedMethod::Drift)
    }

    fn drift_joined(&self, now: &[Now<'_>], _: Layout, each: usize, x: &[f64], dx: &mut [f64]) {
        let Some(method) = self.motion else {
            return;
        };
        let n = self.sizes.states;
        let points = each / n;
        let mut table = PointTable::new(points * now.len(), &now[0], n);
        for (point, x) in x.chunks_exact(n).enumerate() {
            table.put(point, &now[point / points], |state| x[state]);
        }
        let rows = self.ask(method, &now[0], table);
        set(rows.as_deref(), n, n, dx);
    }

    fn fault(&self, theta: &[f64]) -> Option<SimulationError> {
        // Nothing else matters once the program is broken.
        if let Err(error) = self.asker.health.check() {
            return Some(error);
        }
        let mut faults = locked(&self.faults);
        let own = faults.iter().position(|(at, _)| at == theta)?;
        faults.remove(own).map(|(_, error)| error)
    }
}

/// Gives lanes that no filter uses the numbers of the first.
fn idle_as_first(used: usize, all: &mut [Lanes]) {
    for lanes in all {
        let first = lanes.0[0];
        lanes.0[used..].fill(first);
    }
}
