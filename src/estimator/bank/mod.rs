//! Simulations compressed to features: banks for training, clouds around an estimate, nulls for tests.
//!
//! | to … | look at |
//! |---|---|
//! | simulate a twin and take features | [`FeatureSimulator`] |
//! | make many rows, each a pure function of its number | [`FeatureSimulator::draws`], [`Draws`] |
//! | simulate from a study's prior | [`Prior`] |
//! | train on more rows than fit into memory | [`Bank`] |
//! | exchange rows with NumPy and spreadsheets | [`file`] |

mod draws;
pub mod file;
mod npy;
mod prior;
mod simulator;

pub use draws::{Bank, Draw, Draws};
pub use prior::Prior;
pub use simulator::FeatureSimulator;
