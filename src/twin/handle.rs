//! The handle by which every stage holds a twin.

use super::composed::{Entry, FREE_RUNS, Parts, check_start};
use super::definitions::defined_states;
use crate::record::{Drive, Record, RecordError, Signal, Signals};
use crate::twin::{
    Composed, ComposedBlackBox, DigitalTwin, Hold, Integrator, KnownNoise, Noise, Now, Outline,
    Parameter, ParameterSpace, SimulationError, Stepping, StepsTaken, TwinError, TwinPart,
};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A twin of either kind, cheap to clone. A stage that needs equations matches once, at its entrance.
///
/// ```
/// use truetwin::twin::Twin;
/// use truetwin::twins::VanDerPol;
///
/// let twin = Twin::new(VanDerPol);
/// assert!(matches!(twin, Twin::Equations(_)));
/// assert_eq!(twin.parameters().names(), ["nu"]);
/// ```
#[derive(Clone)]
pub enum Twin {
    /// A twin that shows its equations.
    Equations(Composed),
    /// A twin that can only be simulated.
    BlackBox(ComposedBlackBox),
}

debug_by_name!(Twin);

impl Twin {
    /// The handle of `twin`.
    pub fn new(twin: impl DigitalTwin + 'static) -> Self {
        Arc::new(twin).into()
    }

    /// Names, units, prior box and physical bounds, in the order of θ.
    pub fn parameters(&self) -> ParameterSpace {
        match self {
            Self::Equations(twin) => twin.outline().parameters,
            Self::BlackBox(twin) => twin.parameters(),
        }
    }

    /// Input and output channels.
    pub fn signals(&self) -> Signals {
        match self {
            Self::Equations(twin) => twin.outline().signals(),
            Self::BlackBox(twin) => twin.signals(),
        }
    }

    /// Outputs as [`DigitalTwin::simulate`] gives them.
    pub fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        match self {
            Self::Equations(twin) => twin.run(theta, drive, noise),
            Self::BlackBox(twin) => {
                self.check_drive(drive).map_err(SimulationError::of)?;
                twin.simulate(theta, drive, noise)
            }
        }
    }

    /// Outputs without noise as [`DigitalTwin::free_run`] gives them.
    pub fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        match self {
            Self::Equations(twin) => twin.run(theta, drive, Noise::OFF),
            Self::BlackBox(twin) => {
                self.check_drive(drive).map_err(SimulationError::of)?;
                twin.free_run(theta, drive)
            }
        }
    }

    /// Returns whether a record fits the noise level of this state.
    pub(crate) fn fits_noise_of(&self, state: usize) -> bool {
        match self {
            Self::Equations(twin) => twin.fits_noise_of(state),
            Self::BlackBox(_) => false,
        }
    }

    /// Process noise that the code adds to each state in a step of this length at the prior's centre; empty for a black box.
    pub(crate) fn process_noise(&self, dt: f64) -> Vec<(String, f64)> {
        let Self::Equations(twin) = self else {
            return vec![];
        };
        let outline = twin.outline();
        let theta = outline.parameters.centre();
        let inputs = vec![0.0; outline.inputs.len()];
        let now = Now::new(0.0, dt, &inputs, &theta);
        let mut x = vec![0.0; outline.states.len()];
        let (mut process, mut measurement) = (x.clone(), vec![0.0; outline.outputs.len()]);
        twin.start(&now, &mut x);
        twin.noise(&now, &x, &mut process, &mut measurement);
        let names = outline.states.into_iter().map(|state| state.name);
        names.zip(process).collect()
    }

    /// Checks that the twin can be simulated on the time grid of a drive: equations start no later than at its first row, a black box needs one
    /// step.
    pub(crate) fn check_drive(&self, drive: &Drive) -> Result<(), RecordError> {
        match self {
            Self::Equations(_) => self.check_start(drive),
            Self::BlackBox(_) => drive.check_uniform(),
        }
    }

    /// Checks that equations start no later than at the first row of a drive.
    pub(crate) fn check_start(&self, drive: &Drive) -> Result<(), RecordError> {
        match self {
            Self::Equations(twin) => check_start(twin, drive).map_err(RecordError::Start),
            Self::BlackBox(_) => Ok(()),
        }
    }

    /// Outputs where their noise is known, so that a likelihood needs no ensemble of runs; `None` of equations.
    pub(crate) fn known_noise(
        &self,
        theta: &[f64],
        drive: &Drive,
    ) -> Result<Option<KnownNoise>, SimulationError> {
        match self {
            Self::Equations(_) => Ok(None),
            Self::BlackBox(twin) => twin.known_noise(theta, drive),
        }
    }

    /// The equations; `None` for a black box.
    pub fn equations(&self) -> Option<&Composed> {
        match self {
            Self::Equations(twin) => Some(twin),
            Self::BlackBox(_) => None,
        }
    }

    /// Names and units of the equations; `None` for a black box.
    pub fn outline(&self) -> Option<Outline> {
        self.equations().map(Composed::outline)
    }

    /// Number of simulations that a free run takes.
    pub(crate) fn runs_of_a_free_run(&self) -> usize {
        match self {
            Self::Equations(_) => 1,
            Self::BlackBox(_) => FREE_RUNS as usize,
        }
    }

    /// Which states' rates are other states by definition; empty for a black box.
    pub(crate) fn defined_states(&self) -> Vec<bool> {
        match self {
            Self::Equations(twin) => defined_states(twin),
            Self::BlackBox(_) => vec![],
        }
    }

    /// Correlated disturbances: where each enters, the index of its state, the entry of its size in θ; none of a black box.
    pub(crate) fn disturbances(&self) -> Vec<(Entry, usize, usize)> {
        self.equations().map_or(vec![], Composed::disturbances)
    }

    /// Noise levels at the first row of a drive and its start: process, an increment a step, and measurement; none of a black box.
    pub(crate) fn first_noise(&self, theta: &[f64], drive: &Drive) -> Option<[Vec<f64>; 2]> {
        let twin = self.equations()?;
        let outline = twin.outline();
        let now = Now::new(drive.time(0), drive.step(0), drive.input(0), theta);
        let mut start = vec![0.0; outline.states.len()];
        twin.start(&now, &mut start);
        let mut process = vec![0.0; outline.states.len()];
        let mut measurement = vec![0.0; outline.outputs.len()];
        twin.noise(&now, &start, &mut process, &mut measurement);
        Some([process, measurement])
    }

    /// Returns which inputs are amounts that are added at a row; none of a black box.
    pub(crate) fn doses(&self) -> Vec<bool> {
        let holds = self.equations().map(Composed::holds);
        let all = holds.iter().flatten();
        all.map(|hold| *hold == Hold::Impulse).collect()
    }

    /// Returns the time that its start belongs to; `None` for the first row of a record.
    pub(crate) fn begins(&self) -> Option<f64> {
        self.equations()?.begins()
    }

    /// Returns the names of events whose times all lie outside these records; none of a black box.
    pub(crate) fn events_outside(&self, theta: &[f64], records: &[Record]) -> Vec<&str> {
        (self.equations()).map_or_else(Vec::new, |twin| twin.events_outside(theta, records))
    }

    /// Returns the adaptive substeps of a run without noise at θ; `None` for fixed steps, a run that diverges, and a black box.
    pub(crate) fn steps_taken(&self, theta: &[f64], drive: &Drive) -> Option<StepsTaken> {
        self.equations()?.steps_taken(theta, drive).ok()?
    }

    /// Integrator and stepping; `None` for a black box.
    pub(crate) fn integration(&self) -> Option<(Integrator, Stepping)> {
        let equations = self.equations()?;
        Some((equations.integrator(), equations.stepping()))
    }

    /// The twin with another integrator and stepping, as `change` makes them; `None` for a black box.
    pub(crate) fn stepped(
        &self,
        change: impl FnOnce(&mut Integrator, &mut Stepping),
    ) -> Option<Self> {
        let (mut integrator, mut stepping) = self.integration()?;
        change(&mut integrator, &mut stepping);
        Some(self.with([], vec![TwinPart::Steps(integrator, stepping)]))
    }

    /// The twin with `hook` called before each of its runs; an error of the hook stops the run.
    pub(crate) fn watched(
        &self,
        hook: impl Fn() -> Result<(), SimulationError> + Send + Sync + 'static,
    ) -> Self {
        self.with([], vec![TwinPart::Hook(Arc::new(hook))])
    }

    /// Runs `work` with as many threads as passes of this twin should be under way at once: where each call of the equations waits for an
    /// exchange that passes share, threads that wait take no core. With fewer threads at hand the numbers are the same.
    pub(crate) fn side_by_side<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        let passes = self.equations().map_or(1, Composed::beside);
        if passes <= rayon::current_num_threads() {
            return work();
        }
        match rayon::ThreadPoolBuilder::new().num_threads(passes).build() {
            Ok(pool) => pool.install(work),
            Err(_) => work(),
        }
    }
}

/// Parts of a twin of either kind.
impl Twin {
    fn parts(&self) -> &Parts {
        match self {
            Self::Equations(twin) => twin.parts(),
            Self::BlackBox(twin) => twin.parts(),
        }
    }

    fn of(&self, parts: Arc<Parts>) -> Self {
        match self {
            Self::Equations(twin) => Self::Equations(twin.of(parts)),
            Self::BlackBox(twin) => Self::BlackBox(twin.of(parts)),
        }
    }

    /// Number of all parameters, held ones counted: the entry of the next one.
    pub(crate) fn entries(&self) -> usize {
        self.parts().entries()
    }

    /// Returns the entry of the free parameter of this index.
    pub(crate) fn entry(&self, free: usize) -> usize {
        self.parts().entry(free)
    }

    /// Returns the twin with parameters and parts more. Parts act together: along a signal in this order, behind those that are there. A
    /// black box takes those that act on signals and their noise.
    pub(crate) fn with(
        &self,
        parameters: impl IntoIterator<Item = Parameter>,
        parts: Vec<TwinPart>,
    ) -> Self {
        self.of(self.parts().with(parameters, parts))
    }

    /// Returns the twin with priors and bounds as `change` leaves them.
    pub(super) fn with_space(
        &self,
        change: impl FnOnce(&mut ParameterSpace) -> Result<(), TwinError>,
    ) -> Result<Self, TwinError> {
        Ok(self.of(self.parts().with_space(change)?))
    }

    /// Returns the twin with these parameters held, which it has; `free` are the others.
    pub(super) fn holding(&self, values: &BTreeMap<String, f64>, free: ParameterSpace) -> Self {
        self.of(self.parts().holding(values, free))
    }
}

impl<T: DigitalTwin + 'static> From<Arc<T>> for Twin {
    fn from(twin: Arc<T>) -> Self {
        (twin as Arc<dyn DigitalTwin>).into()
    }
}

impl From<Arc<dyn DigitalTwin>> for Twin {
    fn from(twin: Arc<dyn DigitalTwin>) -> Self {
        match twin.clone().equations() {
            Some(equations) => Self::Equations(equations),
            None => Self::BlackBox(twin.into()),
        }
    }
}

impl DigitalTwin for Twin {
    fn parameters(&self) -> ParameterSpace {
        self.parameters()
    }
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        self.simulate(theta, drive, noise)
    }
    fn signals(&self) -> Signals {
        self.signals()
    }
    fn free_run(&self, theta: &[f64], drive: &Drive) -> Result<Signal, SimulationError> {
        self.free_run(theta, drive)
    }
    fn equations(self: Arc<Self>) -> Option<Composed> {
        match self.as_ref() {
            Self::Equations(twin) => Some(twin.clone()),
            Self::BlackBox(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::fixture::{OneState, Unseen};
    use crate::twin::{Adaptation, Interval, NoiseLevel, StartLevel, adapt, fix};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// ẋ = −k·x, y = x with a noisy sensor.
    fn decay() -> OneState {
        OneState {
            inputs: 0,
            start: Some(1.0),
            noise: [0.0, 0.1],
            ..OneState::leaking(Parameter::new("k", "1/s", 0.5, 2.0))
        }
    }

    #[test]
    fn a_watched_twin_runs_as_before_and_each_run_is_seen() {
        let drive = Drive::autonomous(0.1, 20).unwrap();
        for (twin, runs) in [(Twin::new(decay()), 1), (Twin::new(Unseen(decay())), 32)] {
            let seen = Arc::new(AtomicUsize::new(0));
            let counter = seen.clone();
            let watched = twin.watched(move || {
                counter.fetch_add(1, Ordering::Relaxed);
                Ok(())
            });
            let noise = Noise::new(1, "watched", 0);
            let run = |twin: &Twin| twin.simulate(&[1.0], &drive, noise).unwrap();
            assert_eq!(run(&watched), run(&twin));
            let free = |twin: &Twin| twin.free_run(&[1.0], &drive).unwrap();
            assert_eq!(free(&watched), free(&twin));
            assert_eq!(seen.load(Ordering::Relaxed), 1 + runs);
            assert_eq!(twin.runs_of_a_free_run(), runs);
        }
        let stopped = Twin::new(decay()).watched(|| Err(SimulationError::fatal("stop")));
        assert!(stopped.simulate(&[1.0], &drive, Noise::OFF).is_err());
    }

    #[test]
    fn unknown_starts_and_noise_levels_are_found_by_name() {
        let adaptation = Adaptation {
            prior: [("start.x".to_owned(), Interval::unchecked(0.0, 5.0))].into(),
            noise: [("y".to_owned(), NoiseLevel::Estimate)].into(),
            start: [("x".to_owned(), StartLevel::Estimate)].into(),
            ..Adaptation::default()
        };
        let twin = adapt(Twin::new(decay()), &adaptation, 0.1).unwrap();
        assert_eq!(twin.parameters().names(), ["k", "noise.y", "start.x"]);
        let drive = Drive::autonomous(0.1, 20).unwrap();
        let noise = Noise::new(1, "adapted", 0);
        let own = Twin::new(decay()).simulate(&[1.0], &drive, noise).unwrap();
        let run = |twin: &Twin, theta: &[f64]| twin.simulate(theta, &drive, noise).unwrap();
        assert_eq!(run(&twin, &[1.0, 0.1, 1.0]), own);
        let silent = run(&twin, &[1.0, 0.0, 3.0]);
        assert_eq!((silent[[0, 0]], silent[[1, 0]]), (3.0, 2.7));
        let held = fix(twin, &[("noise.y".to_owned(), 0.1)].into()).unwrap();
        assert_eq!(run(&held, &[1.0, 1.0]), own);
        let refused = adapt(Twin::new(Unseen(decay())), &adaptation, 0.1).err();
        assert_eq!(refused, Some(TwinError::BlackBox("noise")));
    }
}
