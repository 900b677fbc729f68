//! What a user implements, and the data that flows through every layer.
//!
//! | to … | look at |
//! |---|---|
//! | plug in a simulator whose equations are at hand | [`StateSpace`] |
//! | plug in a black box | [`DigitalTwin`] |
//! | hold a twin of either kind | [`Twin`] |
//! | say what is estimated, from where to where | [`ParameterSpace`], [`Parameter`], [`Interval`] |
//! | draw noise that pairs across runs | [`Noise`] |
//! | change limits, noise, start or prior of a twin | [`Adaptation`], [`adapt`], [`fix`] |
//! | find out what is wrong with a new twin | [`conformance`] |

mod adapt;
mod advance;
pub mod conformance;
mod digital_twin;
mod direction;
mod error;
mod fix;
mod handle;
mod integrator;
mod interval;
mod modified;
mod names;
mod noise;
mod outline;
mod parameter;
mod state_space;

pub use adapt::{Adaptation, Level, adapt};
pub(crate) use advance::{Advance, Points};
pub(crate) use digital_twin::FREE_RUNS;
pub use digital_twin::{DigitalTwin, SimulationError};
pub(crate) use direction::{combination, oriented};
pub use error::TwinError;
pub use fix::fix;
pub use handle::Twin;
pub use integrator::{Integrator, Workspace};
pub use interval::Interval;
pub(crate) use modified::{Modified, Modify};
pub(crate) use names::check_twin;
pub use noise::{Noise, Source};
pub use outline::Outline;
pub(crate) use parameter::PRIOR_DEVIATION;
pub use parameter::{Parameter, ParameterSpace, Role};
pub use state_space::{Now, Outliers, StateSpace};
