//! An instance at given parameters, as a function of time, inputs and states.
//!
//! An FMU remembers: its relations (`h > 3`) change in events alone. So that rates depend on nothing but their arguments, every evaluation begins
//! from the instance as it was initialised. Where a relation is another one there, the FMU treats that as an event first; the instance then is
//! initialised again before it is asked elsewhere.

use super::ExchangeModel;
use super::instance::ExchangeInstance;
use crate::twin::SimulationError;

/// Events at times up to the one that is asked, at most: each is treated anew in every evaluation behind it.
const MOST_TIMES: usize = 200;
/// Shares of a step by which the way is gone back to before an event: far above what its place is known to, and from there on until the
/// indicator shows it.
const BACK: [f64; 4] = [1e-9, 1e-7, 1e-5, 1e-3];

type Outcome<T> = Result<T, SimulationError>;

/// Arguments of an evaluation.
#[derive(Clone, Copy)]
pub(super) struct EvaluatedAt<'a> {
    /// On the FMU's clock.
    pub t: f64,
    pub u: &'a [f64],
    pub x: &'a [f64],
}

/// Cause of an event.
#[derive(Clone, Copy)]
pub(super) enum FmuEvent {
    /// The indicator of this index becomes positive (`true`) or negative.
    Indicator(usize, bool),
    Time,
}

enum Ready {
    No,
    Yes,
    /// Why these parameters cannot be simulated.
    Refused(String),
}

/// An instance, its parameters, and what it was told last.
pub(super) struct ExchangeBench {
    instance: ExchangeInstance,
    pub theta: Vec<f64>,
    /// When it was used last.
    pub used: u64,
    is_fresh: bool,
    ready: Ready,
    /// States, indicators and the first foreseen event after the initialisation.
    start: Vec<f64>,
    at_start: Vec<f64>,
    first_event: Option<f64>,
    /// Times of foreseen events, where they were asked.
    times: Option<Vec<f64>>,
    /// Arguments that are set; not a number where that is unknown.
    t: f64,
    u: Vec<f64>,
    x: Vec<f64>,
    indicators: Vec<f64>,
}

impl ExchangeBench {
    /// With parameters, which are set when it is used.
    pub fn new(model: &ExchangeModel, theta: &[f64]) -> Result<Self, fmi::Error> {
        let states = model.states;
        Ok(Self {
            instance: ExchangeInstance::new(&model.archive)?,
            theta: theta.to_vec(),
            used: 0,
            is_fresh: true,
            ready: Ready::No,
            start: vec![0.0; states],
            at_start: vec![0.0; model.indicators],
            first_event: None,
            times: None,
            t: f64::NAN,
            u: vec![f64::NAN; model.references.inputs.len()],
            x: vec![f64::NAN; states],
            indicators: vec![0.0; model.indicators],
        })
    }

    /// Takes other parameters.
    pub fn change_theta(&mut self, theta: &[f64]) {
        self.theta.clear();
        self.theta.extend_from_slice(theta);
        (self.ready, self.times) = (Ready::No, None);
    }

    /// Whatever the instance is in, it is initialised before it is asked again.
    pub fn distrust(&mut self) {
        if matches!(self.ready, Ready::Yes) {
            self.ready = Ready::No;
        }
    }

    /// Initialises the instance if it is not as initialised.
    ///
    /// # Errors
    ///
    /// Parameters that the FMU refuses: once said, it is remembered.
    pub fn prepare(&mut self, model: &ExchangeModel) -> Outcome<()> {
        match &self.ready {
            Ready::Yes => return Ok(()),
            Ready::Refused(problem) => return Err(SimulationError::Failed(problem.clone().into())),
            Ready::No => {}
        }
        if !self.is_fresh && self.instance.reset().is_err() {
            let made = ExchangeInstance::new(&model.archive);
            self.instance = made.map_err(|e| SimulationError::Failed(e.to_string().into()))?;
        }
        self.is_fresh = false;
        self.t = f64::NAN;
        self.u.fill(f64::NAN);
        self.x.fill(f64::NAN);
        let references = &model.references.parameters;
        let begun = (self.instance).initialise(model.start, references, &self.theta);
        match begun {
            Ok(first_event) => self.first_event = first_event,
            Err(SimulationError::Failed(problem)) => {
                self.ready = Ready::Refused(problem.to_string());
                return Err(SimulationError::Failed(problem));
            }
            Err(error) => return Err(error),
        }
        self.instance.states(&mut self.start)?;
        self.instance.indicators(&mut self.at_start)?;
        self.ready = Ready::Yes;
        Ok(())
    }

    /// The states after the initialisation.
    pub fn start(&mut self, model: &ExchangeModel, x: &mut [f64]) -> Outcome<()> {
        self.prepare(model)?;
        x.copy_from_slice(&self.start);
        Ok(())
    }

    pub fn rates(
        &mut self,
        model: &ExchangeModel,
        at: EvaluatedAt<'_>,
        dx: &mut [f64],
    ) -> Outcome<()> {
        self.place(model, at)?;
        self.instance.rates(dx)
    }

    pub fn outputs(
        &mut self,
        model: &ExchangeModel,
        at: EvaluatedAt<'_>,
        y: &mut [f64],
    ) -> Outcome<()> {
        self.place(model, at)?;
        // Outputs are those behind a step of the record.
        self.complete_step(model, at)?;
        self.instance.get(&model.references.outputs, y)
    }

    /// Tells the FMU, where it needs to know, that a step ends here. What it changes then holds for this evaluation alone.
    fn complete_step(&mut self, model: &ExchangeModel, at: EvaluatedAt<'_>) -> Outcome<()> {
        if !model.told_of_steps {
            return Ok(());
        }
        if self.instance.complete_step()? {
            self.distrust();
            self.instance.event()?;
            self.instance.set_states(at.x)?;
        }
        Ok(())
    }

    /// An event indicator, relations being as at the start: its zero is where they change.
    pub fn indicator(
        &mut self,
        model: &ExchangeModel,
        at: EvaluatedAt<'_>,
        index: usize,
    ) -> Outcome<f64> {
        self.prepare(model)?;
        self.set(model, at)?;
        Ok(self.indicators[index])
    }

    /// Times of foreseen events, up to the most.
    pub fn times(&mut self, model: &ExchangeModel) -> Outcome<&[f64]> {
        if self.times.is_none() {
            self.prepare(model)?;
            let mut times = vec![];
            let mut next = self.first_event;
            while let Some(time) = next.filter(|_| times.len() < MOST_TIMES) {
                self.distrust();
                times.push(time);
                self.instance.set_time(time)?;
                next = self.instance.event()?.filter(|next| *next > time);
            }
            self.times = Some(times);
        }
        Ok(self.times.as_deref().unwrap_or_default())
    }

    /// Lets the FMU change states by an event here; `step` is in seconds, the one that the event is in.
    pub fn change(
        &mut self,
        model: &ExchangeModel,
        (cause, step): (FmuEvent, f64),
        (t, u): (f64, &[f64]),
        x: &mut [f64],
    ) -> Outcome<()> {
        let t = match cause {
            FmuEvent::Indicator(..) => t,
            // The FMU compares times: one that rounding left before the event is none.
            FmuEvent::Time => {
                let close = |time: &&f64| (**time - t).abs() <= BACK[1] * step;
                self.times(model)?
                    .iter()
                    .filter(close)
                    .fold(t, |t, time| t.max(*time))
            }
        };
        let mut back = x.to_vec();
        let mut rates = vec![0.0; x.len()];
        self.rates(model, EvaluatedAt { t, u, x }, &mut rates)?;
        // Behind the time that an event is moved to at most.
        let shares = match cause {
            FmuEvent::Indicator(..) => &BACK[..],
            FmuEvent::Time => &BACK[2..],
        };
        for share in shares {
            let ago = share * step;
            for ((back, x), rate) in back.iter_mut().zip(&*x).zip(&rates) {
                *back = x - ago * rate;
            }
            let before = EvaluatedAt {
                t: t - ago,
                u,
                x: &back,
            };
            // Relations are settled there, so that this event alone is one.
            self.place(model, before)?;
            self.complete_step(model, before)?;
            let FmuEvent::Indicator(index, up) = cause else {
                break;
            };
            self.instance.indicators(&mut self.indicators)?;
            if (self.indicators[index] > 0.0) != up {
                break;
            }
        }
        self.distrust();
        self.instance.set_time(t)?;
        self.instance.set(&model.references.inputs, u, "an input")?;
        self.instance.set_states(x)?;
        self.instance.event()?;
        self.instance.states(x)
    }

    /// Sets what is not set, and reads the indicators there.
    fn set(
        &mut self,
        model: &ExchangeModel,
        EvaluatedAt { t, u, x }: EvaluatedAt<'_>,
    ) -> Outcome<()> {
        let mut is_new = false;
        if self.t != t {
            self.t = f64::NAN;
            self.instance.set_time(t)?;
            (self.t, is_new) = (t, true);
        }
        if self.u != u {
            self.u.fill(f64::NAN);
            self.instance.set(&model.references.inputs, u, "an input")?;
            self.u.copy_from_slice(u);
            is_new = true;
        }
        if self.x != x {
            self.x.fill(f64::NAN);
            self.instance.set_states(x)?;
            self.x.copy_from_slice(x);
            is_new = true;
        }
        if is_new {
            self.instance.indicators(&mut self.indicators)?;
        }
        Ok(())
    }

    /// Sets time, inputs and states, with the relations that hold there.
    fn place(&mut self, model: &ExchangeModel, at: EvaluatedAt<'_>) -> Outcome<()> {
        self.prepare(model)?;
        if let Some(first) = self.first_event.filter(|first| *first <= at.t) {
            self.distrust();
            self.instance.set_states(at.x)?;
            self.instance
                .set(&model.references.inputs, at.u, "an input")?;
            let (mut next, mut passed) = (Some(first), 0);
            while let Some(time) = next.filter(|next| *next <= at.t && passed < MOST_TIMES) {
                self.instance.set_time(time)?;
                next = self.instance.event()?.filter(|next| *next > time);
                passed += 1;
            }
            // What the events left is not what was set.
            self.t = f64::NAN;
            self.x.fill(f64::NAN);
        }
        self.set(model, at)?;
        let pairs = self.indicators.iter().zip(&self.at_start);
        let mut is_other = false;
        for (here, start) in pairs {
            is_other |= (*here > 0.0) != (*start > 0.0);
        }
        if is_other {
            self.distrust();
            self.instance.event()?;
            self.instance.set_states(at.x)?;
        }
        Ok(())
    }
}
