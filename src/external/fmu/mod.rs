//! A twin from an FMU, as Modelica tools, Simulink and many others export them (cargo feature `fmi`).
//!
//! FMI 2.0 and 3.0, model exchange (equations) and co-simulation (a black box). `docs/external-programs.md` explains how the model description is used.

mod archive;
mod black_box;
mod description;
#[cfg(test)]
mod description_tests;
mod exchange;
pub(crate) mod fuzzing;
mod instance;
mod structure;
mod unpack;
mod variable;
mod worker;

use super::check_call;
use super::name;
use crate::record::{Drive, Signal, Signals};
use crate::study::{RecordPlan, Study, StudyError};
use crate::twin::{Composed, DigitalTwin, Noise, ParameterSpace, SimulationError};
use archive::{Archive, refused};
use black_box::SteppedFmu;
use description::{Interface, ModelDescription};
use exchange::ExchangeTwin;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use variable::FmuVariable;

/// Settings of an FMU.
///
/// | field | default | |
/// |---|---|---|
/// | `variables` | all | names of the parameters to estimate, of inputs and outputs; if no variable of a kind is named, all of that kind are used |
/// | `co_simulation` | `false` | its own steps, as a black box, even of an FMU that offers its equations as well |
/// | `workers` | one per thread | number of instances of co-simulation that run at once; 1 if the FMU allows no more |
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FmuSettings {
    /// Names of the real parameters, inputs and outputs of the twin; others keep their start value.
    pub variables: Vec<String>,
    /// Number of instances that run at once; `None`: one per thread of the rayon pool that opens the twin.
    pub workers: Option<usize>,
    /// Takes the co-simulation of an FMU that offers its equations as well.
    pub co_simulation: bool,
}

/// An FMU without noise of its own: its equations, of one for model exchange that has states; a black box, of one for co-simulation alone.
///
/// θ are the real parameters. Prior and bounds are `min` and `max` of the description; where one of them is missing, the prior
/// is `start` ± 50 % (`[-1, 1]` for 0) and the bounds reach from a tenth of `start` to ten times (`[-10, 10]`), both cut at the
/// limit that is given. A study file narrows both.
///
/// Equations have the continuous states of the description by name, known starts, limits from their `min` and `max`, and the events of the FMU.
/// Their integrator is [`Adaptive`](crate::twin::Integrator::Adaptive). Each thread has instances of its own.
///
/// In co-simulation, row k is read when time k·Δt is reached, before input k is set: an output that depends on an input directly lags it by a
/// sample. A step that fails is a divergence at its time; a refused initialisation costs the run. Instances are reset between
/// runs and have a thread each. The FMU runs in this process: if it crashes or hangs, so does this.
pub struct FmuTwin {
    inside: Interior,
    path: PathBuf,
    name: String,
    parameters: ParameterSpace,
    signals: Signals,
    plan: RecordPlan,
}

/// Equations or steps.
enum Interior {
    States(Arc<ExchangeTwin>),
    Steps(SteppedFmu),
}

impl std::fmt::Debug for FmuTwin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FmuTwin")
            .field("path", &self.path)
            .field("name", &self.name)
            .finish_non_exhaustive()
    }
}

impl FmuTwin {
    /// Unpacks an FMU, reads its description and makes a first instance.
    ///
    /// # Errors
    ///
    /// A file that is no FMU, or not for this platform; variables that it does not have.
    pub fn open(path: &Path, settings: FmuSettings) -> Result<Self, StudyError> {
        let (mut description, folder) = archive::open(path, settings.co_simulation)?;
        let variables = |problem: String| refused(path, problem);
        description.select(&settings.variables).map_err(variables)?;
        for list in [
            &mut description.parameters,
            &mut description.inputs,
            &mut description.outputs,
        ] {
            for variable in list.iter_mut() {
                variable.name = name::made_fit(&variable.name);
                variable.unit = name::made_fit_unit(&variable.unit);
            }
            let names = list.iter().map(|v| v.name.as_str());
            name::check_all("variables", names).map_err(variables)?;
        }
        if description.outputs.is_empty() {
            return Err(variables("no real output; export it with one".into()));
        }
        let failed = |problem: String| {
            let remedy = "export it with a binary for this platform";
            let problem = format!("the FMU cannot be instantiated: {problem}; {remedy}");
            refused(path, problem)
        };
        let archive = Archive::new(&description, folder).map_err(|e| failed(e.to_string()))?;
        let lacks = archive.lacks(&description.identifier, description.interface);
        if let Some(function) = lacks.map_err(|e| failed(e.to_string()))? {
            return Err(failed(format!("its library has no {function}")));
        }
        let inside = match description.interface {
            Interface::ModelExchange => {
                let twin = ExchangeTwin::new(&description, archive).map_err(failed)?;
                Interior::States(Arc::new(twin))
            }
            Interface::CoSimulation => {
                let twin = SteppedFmu::new(&description, archive, settings.workers);
                Interior::Steps(twin.map_err(|e| failed(e.to_string()))?)
            }
        };
        Ok(Self::of(inside, &description, path))
    }

    fn of(inside: Interior, description: &ModelDescription, path: &Path) -> Self {
        let quantities = |list: &[FmuVariable]| list.iter().map(FmuVariable::quantity).collect();
        let (parameters, signals) = match &inside {
            Interior::States(twin) => (twin.parameters(), twin.signals()),
            Interior::Steps(_) => {
                let parameters = description.parameters.iter().map(FmuVariable::parameter);
                let signals = Signals {
                    inputs: quantities(&description.inputs),
                    outputs: quantities(&description.outputs),
                };
                (ParameterSpace::new(parameters), signals)
            }
        };
        Self {
            inside,
            path: path.into(),
            name: name::made_fit(&description.name),
            parameters,
            plan: description.plan(&signals),
            signals,
        }
    }

    /// Returns the name of the model.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns step and length of the default experiment, with random input levels if all inputs have the same limits.
    pub fn plan(&self) -> &RecordPlan {
        &self.plan
    }

    /// Returns the study of this twin; its record plan is the default experiment.
    ///
    /// # Errors
    ///
    /// As [`Study::new`]: no parameter, or boxes without room.
    pub fn into_study(self) -> Result<Study, StudyError> {
        let (path, name, plan) = (self.path.clone(), self.name.clone(), self.plan.clone());
        Study::new(&name, self, plan).map_err(|error| refused(&path, error))
    }
}

impl DigitalTwin for FmuTwin {
    fn parameters(&self) -> ParameterSpace {
        self.parameters.clone()
    }

    fn signals(&self) -> Signals {
        self.signals.clone()
    }

    /// Simulates without noise: FMUs have none.
    fn simulate(
        &self,
        theta: &[f64],
        drive: &Drive,
        noise: Noise,
    ) -> Result<Signal, SimulationError> {
        check_call(&self.parameters, &self.signals, theta, drive)?;
        match &self.inside {
            Interior::States(twin) => twin.simulate(theta, drive, noise),
            Interior::Steps(twin) => twin.simulate(theta, drive),
        }
    }

    fn equations(self: Arc<Self>) -> Option<Composed> {
        match &self.inside {
            Interior::States(twin) => twin.clone().equations(),
            Interior::Steps(_) => None,
        }
    }
}
