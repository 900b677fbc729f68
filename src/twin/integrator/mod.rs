//! Integrators that carry the equations from one sample to the next.

mod brief;
mod event;
mod event_calls;
mod event_memory;
mod eventful;
mod jump;
mod limits;
mod pair;
mod path;
mod rosenbrock;
mod rule;
mod schedule;
mod spline;
#[cfg(test)]
mod tests;
mod watch;
mod workspace;

use serde::{Deserialize, Serialize};

pub use event::Event;
pub(crate) use event_calls::EventCalls;
pub(super) use limits::felt;
pub use rule::{Integrator, Stepping};
pub(crate) use rule::{MOST_SUBSTEPS, TOLERANCES};
pub use schedule::StepsTaken;
pub(crate) use spline::Bends;
pub(crate) use workspace::{TellJumps, Workspace};

/// Time, step, inputs and parameters at which equations are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct Now<'a> {
    /// Time in seconds on the record's own clock: `t` of its rows.
    pub t: f64,
    /// Step Δt in seconds: to the next sample, or a substep where [`StateSpace::drift`](crate::twin::StateSpace::drift) is evaluated.
    pub dt: f64,
    /// Time at the end of the step, to the last digit that of the next sample: t + Δt may be rounded to the number beside it. For integrators:
    /// it stays where laws and noise see another time or step.
    pub(crate) end: f64,
    /// Time in seconds since the sample before, over which what a sensor remembers has moved; Δt at the first one.
    pub(crate) since: f64,
    /// Inputs at this time.
    pub u: &'a [f64],
    /// Parameters θ.
    pub theta: &'a [f64],
    /// Position between samples; `None` where inputs are held from one to the next.
    pub(crate) between: Option<Between<'a>>,
    /// Time of the first row: laws of effects count from there.
    pub(crate) first_time: f64,
    /// Time that the start belongs to, the first row's or one before it: delays count from there.
    pub(crate) begun: f64,
    /// Time in seconds by which an output that shows this sample late is read after it; `None` where that is as many whole samples as its dead time has.
    pub(crate) read_after: Option<f64>,
}

impl<'a> Now<'a> {
    /// Time `t`, step `dt`, inputs `u` held over the step, and parameters θ; the first row is at 0.
    pub fn new(t: f64, dt: f64, u: &'a [f64], theta: &'a [f64]) -> Self {
        Self {
            t,
            dt,
            end: t + dt,
            since: dt,
            u,
            theta,
            between: None,
            first_time: 0.0,
            begun: 0.0,
            read_after: None,
        }
    }

    /// Time in seconds over which a memory moves at this sample: an input acts over the step behind it, everything else is seen after the one
    /// before.
    #[inline]
    pub(crate) fn memory_step(&self, of_input: bool) -> f64 {
        if of_input { self.dt } else { self.since }
    }
}

/// A position between two samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Between<'a> {
    /// Inputs at the next sample.
    pub next: &'a [f64],
    /// Rule of each input between this sample and the next.
    pub holds: &'a [Hold],
    /// [`Bends`] of each input, here and at the next sample; empty where none is on a spline.
    pub bends: &'a [f64],
}

impl Between<'_> {
    /// Returns whether an input jumps half-way.
    pub fn jumps_half_way(&self) -> bool {
        self.holds.contains(&Hold::Nearest)
    }

    /// Inputs at a share of the way to the next sample, in a step whose middle is at another.
    pub fn inputs_at(&self, at: f64, middle: f64, u: &[f64], to: &mut [f64]) {
        let rules = self.holds.iter().enumerate();
        for (((to, u), next), (j, hold)) in to.iter_mut().zip(u).zip(self.next).zip(rules) {
            let on_line = || u + hold.share(at, middle) * (next - u);
            *to = match hold {
                Hold::Zero => *u,
                Hold::Impulse => 0.0,
                Hold::Linear | Hold::Nearest => on_line(),
                Hold::Spline => {
                    let (left, bends) = (1.0 - at, &self.bends[2 * j..]);
                    on_line() + ((left.powi(3) - left) * bends[0] + (at.powi(3) - at) * bends[1])
                }
            };
        }
    }

    /// Adds to states what inputs add at this sample: the difference that they make to the rates, as an amount.
    pub fn jump(&self, now: &Now<'_>, x: &mut [f64], inputs: &mut [f64], drift: &mut Rates<'_>) {
        let is_dose = |(hold, u): (&Hold, &f64)| *hold == Hold::Impulse && *u != 0.0;
        if !self.holds.iter().zip(now.u).any(is_dose) {
            return;
        }
        let (mut with, mut without) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        drift(now, x, &mut with);
        inputs.copy_from_slice(now.u);
        remove_amounts(inputs, self.holds);
        let nothing = Now { u: inputs, ..*now };
        drift(&nothing, x, &mut without);
        for ((x, with), without) in x.iter_mut().zip(&with).zip(&without) {
            *x += with - without;
        }
    }
}

/// Sets inputs to zero that are amounts, which are added at a row alone.
pub(crate) fn remove_amounts(inputs: &mut [f64], holds: &[Hold]) {
    for (input, hold) in inputs.iter_mut().zip(holds) {
        if *hold == Hold::Impulse {
            *input = 0.0;
        }
    }
}

/// Inputs between two samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// Held at the value of the sample before.
    #[default]
    Zero,
    /// On the line from one sample to the next; the last is held.
    Linear,
    /// Held at the value of the nearest sample: what a smooth input does that was sampled, and not held. Of an odd number of substeps, the middle
    /// one is two of half its length; the last is held.
    Nearest,
    /// On the natural cubic spline through all samples: a smooth input that was sampled several times a period. The last is held.
    Spline,
    /// An amount that is added at its row, a dose: the states jump by ∂f/∂u times it, and between samples the input is zero. In discrete
    /// time it is held: the next state is told the amount.
    Impulse,
}

impl Hold {
    /// All rules, each with its name in files.
    pub(crate) const NAMES: [(Self, &str); 5] = [
        (Self::Zero, "zero"),
        (Self::Linear, "linear"),
        (Self::Spline, "spline"),
        (Self::Nearest, "nearest"),
        (Self::Impulse, "impulse"),
    ];

    /// Name in files.
    pub(crate) fn name(self) -> &'static str {
        let mut all = Self::NAMES.iter();
        all.find(|(hold, _)| *hold == self)
            .map_or("", |(_, name)| *name)
    }

    /// Share of the next sample's input at a share of the way, in a step whose middle is at another.
    fn share(self, at: f64, middle: f64) -> f64 {
        match self {
            Self::Zero | Self::Impulse => 0.0,
            Self::Linear | Self::Spline => at,
            Self::Nearest => f64::from(middle >= 0.5),
        }
    }
}

/// Equations that set rates of points.
pub(crate) type Rates<'r> = dyn FnMut(&Now<'_>, &[f64], &mut [f64]) + 'r;
