//! Simulators: the traits that a user implements, parameters, noise, and the handle that stages hold.
//!
//! | to … | look at |
//! |---|---|
//! | plug in a simulator whose equations are at hand | [`StateSpace`] |
//! | plug in a black box | [`DigitalTwin`] |
//! | hold a twin of either kind | [`Twin`] |
//! | name what is estimated, with prior and bounds | [`ParameterSpace`], [`Parameter`], [`Interval`] |
//! | draw noise that pairs across runs | [`Noise`] |
//! | find out what is wrong with a new twin | [`conformance`] |

mod adapt;
mod blocks;
mod composed;
pub mod conformance;
mod definitions;
mod error;
#[cfg(test)]
pub(crate) mod fixture;
mod handle;
mod integrator;
mod interval;
mod names;
mod noise;
mod parameter;
mod points;
mod state_space;

pub(crate) use adapt::{
    Adaptation, DeclaredNoise, KNOWN_WITH_FACTOR, NoiseLevel, StartLevel, adapt, begun, fix,
};
pub(crate) use blocks::Blocks;
pub(crate) use composed::{
    Acting, DeadTime, Disturbance, Entry, FittedLevels, Follows, KnownNoise, LARGEST, Law, LawPart,
    LawPlace, LevelFactors, LevelSource, LevelValue, NoisePart, ParameterChange, RateChange,
    Remember, Seen, SensorNoise, SignalChange, StateLimit, TwinPart, WhiteLevel, seconds_before,
};
pub use composed::{Composed, ComposedBlackBox, DigitalTwin};
pub(crate) use definitions::rates;
pub use error::{SimulationError, TwinError};
pub use handle::Twin;
pub(crate) use integrator::{
    Bends, Between, EventCalls, MOST_SUBSTEPS, TOLERANCES, TellJumps, Workspace,
};
pub use integrator::{Event, Hold, Integrator, Now, Stepping, StepsTaken};
pub use interval::Interval;
pub(crate) use names::{check_twin, is_memory};
pub(crate) use noise::mix;
pub use noise::{Noise, Source};
pub(crate) use parameter::{PRIOR_DEVIATION, combination, oriented};
pub use parameter::{Parameter, ParameterSpace, Role, Side};
pub(crate) use points::{LanePlaces, Layout, MOST_STATES, Points};
pub use state_space::{Outliers, Outline, StateSpace};
