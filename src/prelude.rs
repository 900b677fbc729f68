//! The usual names: `use truetwin::prelude::*`. The [crate page](crate) shows them at work.

pub use crate::diagnose::{DiagnoseSettings, diagnose};
pub use crate::estimator::{EstimateOptions, Estimator, PretrainOptions, Project, pretrain};
pub use crate::progress::Progress;
pub use crate::record::{Drive, Quantity, Record, Signal};
pub use crate::study::{RecordPlan, Study, StudyError};
pub use crate::twin::{
    DigitalTwin, Noise, Now, Outline, Parameter, ParameterSpace, SimulationError, StateSpace, Twin,
};
