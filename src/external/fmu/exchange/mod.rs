//! An FMU's equations as a twin with states (FMI for model exchange).

mod bench;
mod desk;
mod instance;

use super::archive::Archive;
use super::description::ModelDescription;
use super::variable::FmuVariable;
use super::worker::References;
use crate::external::name;
use crate::twin::{Event, Integrator, Interval, Now, Outline, SimulationError, StateSpace};
use bench::{EvaluatedAt, ExchangeBench, FmuEvent};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Archive and references that every instance is made from.
struct ExchangeModel {
    archive: Archive,
    references: References,
    states: usize,
    indicators: usize,
    /// It is told of each step that is complete.
    told_of_steps: bool,
    /// Time of the initialisation, which is 0 on a record's clock.
    start: f64,
    /// `true` after a fatal error: no function may be called any more.
    is_corrupt: AtomicBool,
}

/// The equations of an FMU.
///
/// States are those of the description, from the start that the FMU computes at its parameters, within their `min` and `max`. An evaluation that
/// the FMU refuses is not a number: the run diverges there.
pub(super) struct ExchangeTwin {
    model: Arc<ExchangeModel>,
    outline: Outline,
    limits: Vec<Interval>,
}

impl ExchangeTwin {
    /// With a first instance, initialised at its own start values.
    pub fn new(description: &ModelDescription, archive: Archive) -> Result<Self, String> {
        let references = |list: &[FmuVariable]| list.iter().map(|v| v.reference).collect();
        let told_of_steps =
            description.told_of_steps && archive.hears_of_steps(&description.identifier);
        let model = Arc::new(ExchangeModel {
            archive,
            references: References {
                parameters: references(&description.parameters),
                inputs: references(&description.inputs),
                outputs: references(&description.outputs),
            },
            states: description.states.len(),
            indicators: description.indicators,
            told_of_steps,
            start: description.start,
            is_corrupt: AtomicBool::new(false),
        });
        let all = description.parameters.iter();
        let theta: Vec<f64> = all.map(|v| v.start).collect();
        let first = ExchangeBench::new(&model, &theta).map_err(|error| error.to_string())?;
        drop(first);
        // Start values that the FMU refuses need not be those that are asked for.
        let has_times = desk::with(&model, &theta, |bench| Ok(!bench.times(&model)?.is_empty()));
        let mut outline = outline(description)?;
        for index in 0..description.indicators {
            for up in [true, false] {
                outline = outline.event(crossing(&model, index, up));
            }
        }
        if has_times.unwrap_or_default() {
            outline = outline.event(foreseen(&model));
        }
        let limit = |v: &FmuVariable| {
            let (low, high) = (v.min, v.max);
            let ends = (
                low.unwrap_or(f64::NEG_INFINITY),
                high.unwrap_or(f64::INFINITY),
            );
            Interval::new(ends.0, ends.1).unwrap_or(Interval::EVERYTHING)
        };
        Ok(Self {
            model,
            outline,
            limits: description.states.iter().map(limit).collect(),
        })
    }

    /// Fills `to` with numbers of the FMU; with none where it refuses.
    fn filled(
        &self,
        now: &Now<'_>,
        to: &mut [f64],
        ask: impl FnOnce(&mut ExchangeBench, &mut [f64]) -> Result<(), SimulationError>,
    ) {
        let asked = desk::with(&self.model, now.theta, |bench| ask(bench, to));
        if asked.is_err() {
            to.fill(f64::NAN);
        }
    }
}

/// Names and units; an output with a state's name is called `…_output`.
fn outline(description: &ModelDescription) -> Result<Outline, String> {
    let named = |v: &FmuVariable| name::made_fit(&v.name).replace(['/', '@', '.'], "_");
    let unit = |v: &FmuVariable| name::made_fit_unit(&v.unit);
    let words = |v: &FmuVariable| name::made_fit_unit(v.description.trim());
    let mut outline = Outline::new();
    for v in &description.parameters {
        let mut parameter = v.parameter();
        parameter.name = named(v);
        outline = outline.parameter(parameter);
    }
    for v in &description.states {
        let name = named(v);
        outline = outline.state(&name, &unit(v)).describe(&name, &words(v));
    }
    for v in &description.inputs {
        let name = named(v);
        outline = outline.input(&name, &unit(v)).describe(&name, &words(v));
    }
    for v in &description.outputs {
        let mut name = named(v);
        if outline.states.iter().any(|state| state.name == name) {
            name.push_str("_output");
        }
        outline = outline.output(&name, &unit(v)).describe(&name, &words(v));
    }
    let lists = [&outline.states, &outline.inputs, &outline.outputs];
    for names in lists {
        name::check_all("variables", names.iter().map(|q| q.name.as_str()))?;
    }
    name::check_all("variables", outline.parameters.names())?;
    Ok(outline)
}

/// The event of an indicator that becomes positive (`up`) or negative.
fn crossing(model: &Arc<ExchangeModel>, index: usize, up: bool) -> Event {
    let asked = model.clone();
    let margin = move |now: &Now<'_>, x: &[f64]| {
        let at = at(&asked, now, x);
        let z = desk::with(&asked, now.theta, |bench| {
            bench.indicator(&asked, at, index)
        });
        let z = z.unwrap_or(f64::NAN);
        if up { z } else { -z }
    };
    let way = if up { "above" } else { "below" };
    let name = format!("event indicator {} {way} 0", index + 1);
    Event::when(
        &name,
        margin,
        changed(model, FmuEvent::Indicator(index, up)),
    )
}

/// Events at times that the FMU foresees.
fn foreseen(model: &Arc<ExchangeModel>) -> Event {
    let asked = model.clone();
    let times = move |now: &Now<'_>| {
        let times = desk::with(&asked, now.theta, |bench| Ok(bench.times(&asked)?.to_vec()));
        let times = times.unwrap_or_default().into_iter();
        times.map(|time| time - asked.start).collect()
    };
    Event::at("time event", times, changed(model, FmuEvent::Time))
}

fn changed(
    model: &Arc<ExchangeModel>,
    cause: FmuEvent,
) -> impl Fn(&Now<'_>, &mut [f64]) + Send + Sync + 'static {
    let model = model.clone();
    move |now, x| {
        let clock = (model.start + now.t, now.u);
        let change = |bench: &mut ExchangeBench| bench.change(&model, (cause, now.dt), clock, x);
        if desk::with(&model, now.theta, change).is_err() {
            x.fill(f64::NAN);
        }
    }
}

fn at<'a>(model: &ExchangeModel, now: &Now<'a>, x: &'a [f64]) -> EvaluatedAt<'a> {
    EvaluatedAt {
        t: model.start + now.t,
        u: now.u,
        x,
    }
}

impl StateSpace for ExchangeTwin {
    fn outline(&self) -> Outline {
        self.outline.clone()
    }

    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        let at = at(&self.model, now, x);
        self.filled(now, dx, |bench, dx| bench.rates(&self.model, at, dx));
    }

    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        let at = at(&self.model, now, x);
        self.filled(now, y, |bench, y| bench.outputs(&self.model, at, y));
    }

    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.filled(now, x, |bench, x| bench.start(&self.model, x));
    }

    fn limits(&self) -> Vec<Interval> {
        self.limits.clone()
    }

    fn check_parameters(&self, theta: &[f64], _: f64) -> Result<(), SimulationError> {
        desk::with(&self.model, theta, |bench| bench.prepare(&self.model))
    }

    fn integrator(&self) -> Integrator {
        Integrator::Adaptive
    }
}
