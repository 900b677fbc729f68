//! Numbers as people have them: parameters and signals of any magnitude, long records, many parameters and outputs.

mod chain;
mod magnitudes;
mod odd;
mod sizes;

use truetwin::record::{Quantity, Record};
use truetwin::study::{RecordPlan, Study};
use truetwin::twin::{DigitalTwin, Noise, Now, Outline, Parameter, ParameterSpace, StateSpace};
