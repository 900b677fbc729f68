//! Records with known gaps, and what a diagnosis makes of many of them.

use std::collections::BTreeMap;
use truetwin::diagnose::{DiagnoseSettings, Diagnosis, diagnose};
use truetwin::effect::{Catalogue, Effect, augment};
use truetwin::evaluate::paper::reference_studies;
use truetwin::progress::Progress;
use truetwin::record::{Drive, Record, Signal, Signals};
use truetwin::study::Study;
use truetwin::twin::{
    Composed, DigitalTwin, Noise, Now, Outline, ParameterSpace, SimulationError, StateSpace, Twin,
};

pub fn study(name: &str) -> Study {
    let studies = reference_studies().unwrap();
    studies.into_iter().find(|s| s.name() == name).unwrap()
}

/// A twin without its equations: noise and all come out of one box.
pub struct Boxed(pub Twin);

impl DigitalTwin for Boxed {
    fn parameters(&self) -> ParameterSpace {
        self.0.parameters()
    }
    fn signals(&self) -> Signals {
        self.0.signals()
    }
    fn simulate(&self, p: &[f64], d: &Drive, n: Noise) -> Result<Signal, SimulationError> {
        self.0.simulate(p, d, n)
    }
}

/// The study of a twin with its equations hidden.
pub fn boxed(study: &Study) -> Study {
    let twin = Boxed(study.twin().clone());
    study.with_twin(twin).unwrap()
}

/// θ within the prior, or within the middle of the bounds and outside of the prior.
pub fn theta(study: &Study, outside: bool, noise: Noise) -> Vec<f64> {
    let space = study.twin().parameters();
    if !outside {
        return space.draw_prior(noise);
    }
    for i in 0.. {
        let theta = space.draw_bounds(noise.child("outside").sample(i));
        let out = (space.iter().zip(&theta)).any(|(p, v)| !p.prior.contains(*v));
        // The middle: not where the tanks run dry or over.
        let middle = (space.iter().zip(&theta)).all(|(p, v)| {
            let (low, width) = (p.bounds.low(), p.bounds.width());
            (low + 0.1 * width..=low + 0.75 * width).contains(v)
        });
        if out && middle {
            return theta;
        }
    }
    unreachable!("draws do not end")
}

pub fn drive(study: &Study, noise: Noise) -> Drive {
    study.drive(noise).unwrap()
}

/// A record of `twin` with the effects of a text.
pub(crate) fn record(
    twin: &Twin,
    effects: &str,
    theta: &[f64],
    drive: Drive,
    noise: Noise,
) -> Record {
    let effects = Catalogue::default().parse(effects).unwrap();
    let given: BTreeMap<_, _> = effects
        .iter()
        .flat_map(Effect::given_by_parameter)
        .collect();
    let twin = augment(twin.clone(), effects).unwrap();
    let space = twin.parameters();
    let all: Vec<f64> = (space.iter().enumerate())
        .map(|(j, p)| given.get(&p.name).copied().unwrap_or_else(|| theta[j]))
        .collect();
    let outputs = twin.simulate(&all, &drive, noise).unwrap();
    Record::new(drive, outputs).unwrap()
}

/// Effects that a record of a few hundred samples shows, as the text of a file and the key that should be named.
pub fn clear(name: &str) -> Vec<(&'static str, &'static str)> {
    match name {
        "tanks" => vec![
            (
                "sensor-lag@sensor",
                "id='sensor-lag'\ntarget='sensor'\nmagnitudes={tau=2.5}",
            ),
            (
                "sensor-delay@sensor",
                "id='sensor-delay'\ntarget='sensor'\nmagnitudes={delay=1.6}",
            ),
            (
                "sensor-saturation@sensor",
                "id='sensor-saturation'\ntarget='sensor'\nmagnitudes={low=-inf,high=2.4}",
            ),
            (
                "sensor-quantization@sensor",
                "id='sensor-quantization'\ntarget='sensor'\nmagnitudes={step=1.2}",
            ),
            (
                "sensor-noise@sensor",
                "id='sensor-noise'\ntarget='sensor'\nmagnitudes={std=0.3}",
            ),
            (
                "sensor-outliers@sensor",
                "id='sensor-outliers'\ntarget='sensor'\nmagnitudes={probability=0.04,scale=1.5}",
            ),
            (
                "sensor-bias@sensor",
                "id='sensor-bias'\ntarget='sensor'\nmagnitudes={offset=0.8}",
            ),
            (
                "actuator-dead-zone@actuator",
                "id='actuator-dead-zone'\ntarget='actuator'\nmagnitudes={width=1.4}",
            ),
            (
                "actuator-saturation@actuator",
                "id='actuator-saturation'\ntarget='actuator'\nmagnitudes={low=-inf,high=1.6}",
            ),
            (
                "actuator-lag@actuator",
                "id='actuator-lag'\ntarget='actuator'\nmagnitudes={tau=3.0}",
            ),
            (
                "actuator-delay@actuator",
                "id='actuator-delay'\ntarget='actuator'\nmagnitudes={delay=2.4}",
            ),
            (
                "actuator-backlash@actuator",
                "id='actuator-backlash'\ntarget='actuator'\nmagnitudes={width=1.0}",
            ),
            (
                "actuator-bias@actuator",
                "id='actuator-bias'\ntarget='actuator'\nmagnitudes={offset=0.5}",
            ),
            (
                "linear-loss@h1",
                "id='linear-loss'\ntarget='h1'\nmagnitudes={rate=0.25}",
            ),
            (
                "linear-loss@h2",
                "id='linear-loss'\ntarget='h2'\nmagnitudes={rate=0.2}",
            ),
            (
                "cross-coupling@h1",
                "id='cross-coupling'\ntarget='h1'\nfrom='h2'\nmagnitudes={rate=0.15}",
            ),
            (
                "quadratic-drag@h2",
                "id='quadratic-drag'\ntarget='h2'\nmagnitudes={coefficient=0.1}",
            ),
            (
                "periodic-disturbance@h1",
                "id='periodic-disturbance'\ntarget='h1'\nmagnitudes={amplitude=0.4,frequency=0.04,phase=1.0}",
            ),
            (
                "periodic-disturbance@h2",
                "id='periodic-disturbance'\ntarget='h2'\nmagnitudes={amplitude=0.3,frequency=0.015,phase=2.0}",
            ),
            (
                "state-ceiling@h1",
                "id='state-ceiling'\ntarget='h1'\nto='h2'\nmagnitudes={level=2.5,spill=0.5}",
            ),
            (
                "state-ceiling@h2",
                "id='state-ceiling'\ntarget='h2'\nto='h1'\nmagnitudes={level=2.0,spill=0.0}",
            ),
            (
                "process-noise@h2",
                "id='process-noise'\ntarget='h2'\nmagnitudes={std=0.25}",
            ),
            (
                "parameter-step@k3",
                "id='parameter-step'\ntarget='k3'\nmagnitudes={size=0.35,time=90.0}",
            ),
            (
                "parameter-drift@k2",
                "id='parameter-drift'\ntarget='k2'\nmagnitudes={rate=-0.002}",
            ),
            (
                "parameter-step@k4",
                "id='parameter-step'\ntarget='k4'\nmagnitudes={size=-0.3,time=120.0}",
            ),
        ],
        _ => vec![
            (
                "sensor-bias@sensor",
                "id='sensor-bias'\ntarget='sensor'\nmagnitudes={offset=0.1}",
            ),
            (
                "sensor-gain@sensor",
                "id='sensor-gain'\ntarget='sensor'\nmagnitudes={error=0.05}",
            ),
            (
                "sensor-lag@sensor",
                "id='sensor-lag'\ntarget='sensor'\nmagnitudes={tau=0.05}",
            ),
            (
                "sensor-noise@sensor",
                "id='sensor-noise'\ntarget='sensor'\nmagnitudes={std=0.01}",
            ),
            (
                "sensor-rectification@sensor",
                "id='sensor-rectification'\ntarget='sensor'\nmagnitudes={fraction=0.2}",
            ),
            (
                "coulomb-friction@x2",
                "id='coulomb-friction'\ntarget='x2'\nmagnitudes={force=0.15}",
            ),
            (
                "linear-loss@x2",
                "id='linear-loss'\ntarget='x2'\nmagnitudes={rate=0.15}",
            ),
            (
                "quadratic-drag@x2",
                "id='quadratic-drag'\ntarget='x2'\nmagnitudes={coefficient=0.08}",
            ),
            (
                "cubic-stiffness@x2",
                "id='cubic-stiffness'\ntarget='x2'\nfrom='x1'\nmagnitudes={coefficient=0.1}",
            ),
            (
                "constant-forcing@x2",
                "id='constant-forcing'\ntarget='x2'\nmagnitudes={force=0.15}",
            ),
            (
                "periodic-disturbance@x2",
                "id='periodic-disturbance'\ntarget='x2'\nmagnitudes={amplitude=0.2,frequency=0.4,phase=1.0}",
            ),
            (
                "process-noise@x2",
                "id='process-noise'\ntarget='x2'\nmagnitudes={std=0.015}",
            ),
            (
                "parameter-step@nu",
                "id='parameter-step'\ntarget='nu'\nmagnitudes={size=0.3,time=7.0}",
            ),
            (
                "parameter-drift@nu",
                "id='parameter-drift'\ntarget='nu'\nmagnitudes={rate=0.03}",
            ),
        ],
    }
}

/// The tanks or the oscillator with something that no effect of the library says.
pub struct Unlisted {
    pub base: Twin,
    pub kind: usize,
}

/// Number of kinds.
pub const UNLISTED: usize = 4;

impl Unlisted {
    fn inner(&self) -> &Composed {
        self.base.equations().unwrap()
    }
}

impl StateSpace for Unlisted {
    fn outline(&self) -> Outline {
        self.inner().outline()
    }
    fn drift(&self, now: &Now<'_>, x: &[f64], dx: &mut [f64]) {
        self.inner().drift(now, x, dx);
        let tanks = x.len() == 2 && !now.u.is_empty();
        match self.kind {
            // An irregular push that never repeats.
            0 => {
                dx[1] += if tanks { 0.5 } else { 0.3 }
                    * ((0.11 * now.t).sin() * (0.031 * now.t * now.t / 10.0).sin())
            }
            // A force that depends on the product of the states.
            1 => {
                dx[1] += if tanks { -0.15 } else { 0.1 }
                    * x[0]
                    * x[1]
                    * if tanks { 0.5 } else { x[0].signum() }
            }
            // Bursts at odd times.
            2 => {
                let t = now.t / if tanks { 10.0 } else { 1.0 };
                let burst = (t * 0.73).sin() > 0.9 || (t * 0.41).cos() > 0.95;
                dx[0] += if burst {
                    if tanks { 1.0 } else { 0.3 }
                } else {
                    0.0
                };
            }
            // A resonance: a push that follows the state of long ago in a non-linear way.
            _ => dx[1] += if tanks { 0.4 } else { 0.2 } * (4.0 * x[0]).sin(),
        }
    }
    fn observe(&self, now: &Now<'_>, x: &[f64], y: &mut [f64]) {
        self.inner().observe(now, x, y);
    }
    fn start(&self, now: &Now<'_>, x: &mut [f64]) {
        self.inner().start(now, x);
    }
    fn noise(&self, now: &Now<'_>, x: &[f64], process: &mut [f64], measurement: &mut [f64]) {
        self.inner().noise(now, x, process, measurement);
    }
    fn limits(&self) -> Vec<truetwin::twin::Interval> {
        self.inner().limits().to_vec()
    }
}

pub fn with_settings(study: &Study, record: Record, settings: &DiagnoseSettings) -> Diagnosis {
    diagnose(study, &[record], None, settings, &Progress::silent()).unwrap()
}

pub fn found(study: &Study, record: Record, validation: Option<Record>) -> Diagnosis {
    let settings = DiagnoseSettings::default();
    diagnose(
        study,
        &[record],
        validation.as_ref(),
        &settings,
        &Progress::silent(),
    )
    .unwrap()
}

/// A diagnosis with these effects of the library alone, which takes half as long or less: those that a record confuses with the right one.
pub fn found_among(study: &Study, record: Record, ids: &[&str]) -> Diagnosis {
    let every = study.effects();
    assert!(ids.iter().all(|id| every.iter().any(|e| e.id() == *id)));
    let settings = DiagnoseSettings {
        without: (every.iter().map(|e| e.id()))
            .filter(|id| !ids.contains(id))
            .map(Into::into)
            .collect(),
        ..DiagnoseSettings::default()
    };
    with_settings(study, record, &settings)
}

pub fn line(truth: &str, found: &Diagnosis) -> String {
    let which = &found.cause;
    let top: Vec<String> = (which.effects.iter().take(2))
        .map(|e| {
            format!(
                "{} {:.2} ({:.1} nats)",
                e.key(),
                e.probability,
                e.log_evidence
            )
        })
        .collect();
    format!(
        "{truth:28} {:14} {:6.1} nats {:13} acc {:?} class {:?} top {:?} remains {:?} where {:?} shrink {:?} {:.1} s",
        found.verdict.id(),
        found.detection.log_evidence,
        which.decision.id(),
        which.accepted,
        which.class,
        top,
        which.remains.as_ref().map(|r| (&r.place, r.log_evidence)),
        found.location.target,
        found
            .shrinkage
            .as_ref()
            .map(|s| (s.before, s.after, s.floor, s.closed)),
        found.seconds,
    )
}
