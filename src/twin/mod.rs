//! What a user implements, and the data that flows through every layer.
//!
//! | to … | look at |
//! |---|---|
//! | plug in a simulator whose equations are at hand | [`StateSpace`] |
//! | plug in a black box | [`DigitalTwin`] |
//! | say what is estimated, from where to where | [`ParameterSpace`], [`Parameter`], [`Interval`] |
//! | hand over inputs, take a measurement | [`Drive`], [`Record`], [`Signal`] |
//! | draw noise that pairs across runs | [`Noise`] |
//! | change limits, noise, start or prior of a twin | [`Adaptation`], [`adapt`], [`fix`] |
//! | add what a twin lacks | [`UnmodelledEffect`], [`augment`] |
//! | find out what is wrong with a new twin | [`conformance`] |

mod adapt;
mod advance;
mod augment;
pub mod conformance;
mod digital_twin;
mod direction;
mod drive;
mod effect;
mod fix;
mod free_run;
mod integrator;
mod interval;
mod noise;
mod parameter;
mod record;
mod record_csv;
mod record_parquet;
mod state_space;

pub use adapt::{Adaptation, AdaptationError, Level, adapt};
pub(crate) use advance::{Advance, Points};
pub(crate) use augment::augment_short;
pub use augment::{augment, given_magnitudes};
pub use digital_twin::{DigitalTwin, Quantity, Signals, SimulationError};
pub(crate) use direction::{combination, oriented};
pub use drive::{Drive, DriveError, Signal};
pub use effect::{
    EffectError, Effects, Given, Instant, Law, Magnitude, Mark, NOISE_ENTERS, UnmodelledEffect,
};
pub(crate) use effect::{check_effects, targets};
pub use fix::fix;
pub use free_run::free_run;
pub use integrator::{Integrator, Workspace};
pub use interval::{Interval, IntervalError};
pub use noise::{Noise, Source};
pub(crate) use parameter::PRIOR_DEVIATION;
pub use parameter::{Parameter, ParameterError, ParameterSpace, Role};
pub use record::{Record, RecordError};
pub use record_csv::{
    CsvError, drive_csv_text, parse_record, read_drive, read_record, record_csv_text, write_record,
};
pub use state_space::{Now, Outliers, Outline, StateSpace};
