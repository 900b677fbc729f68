//! What a person needs who writes a twin, trains, estimates and diagnoses: `use truetwin::prelude::*`.
//!
//! Everything else stands in the module that it belongs to; layers of a network of one's own are in
//! [`network::layers`](crate::network::layers).
//!
//! ```
//! use truetwin::prelude::*;
//!
//! /// A coffee cup that cools: Ṫ = −rate·T, in degrees above the room.
//! struct Cup;
//!
//! impl StateSpace for Cup {
//!     fn outline(&self) -> Outline {
//!         Outline {
//!             parameters: ParameterSpace::new([Parameter::new("rate", "1/s", 1e-3, 1e-2)]),
//!             states: vec![Quantity::new("T", "K")],
//!             inputs: vec![],
//!             outputs: vec![Quantity::new("y", "K")],
//!         }
//!     }
//!     fn start(&self, _: &Now, x: &mut [f64]) {
//!         x[0] = 60.0;
//!     }
//!     fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
//!         dx[0] = -now.theta[0] * x[0];
//!     }
//!     fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
//!         y[0] = x[0];
//!     }
//! }
//!
//! let drive = Drive::autonomous(10.0, 100)?; // 100 samples, 10 s apart
//! let outputs = Cup.simulate(&[2e-3], &drive, Noise::OFF)?;
//! assert!((outputs[[99, 0]] - 60.0 * 0.98f64.powi(99)).abs() < 1e-9);
//!
//! let study = Study::new("cup", Cup, RecordPlan::autonomous(10.0, 100))?;
//! assert_eq!(study.twin().parameters().names(), ["rate"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use crate::diagnose::{DiagnoseSettings, diagnose};
pub use crate::estimator::{EstimateOptions, Estimator, PretrainOptions, Project, pretrain};
pub use crate::progress::Progress;
pub use crate::record::{Drive, Quantity, Record, Signal};
pub use crate::study::{RecordPlan, Study, StudyError};
pub use crate::twin::{
    DigitalTwin, Noise, Now, Outline, Parameter, ParameterSpace, SimulationError, StateSpace, Twin,
};
