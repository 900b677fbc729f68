//! Simulations compressed to features: banks for training, clouds around an estimate, nulls for tests.
//!
//! | to … | look at |
//! |---|---|
//! | simulate a twin and take features | [`FeatureSimulator`] |
//! | make many rows, each a pure function of its number | [`FeatureSimulator::draws`], [`Draws`] |
//! | train on more rows than fit into memory | [`Bank`] |
//! | exchange rows with NumPy and spreadsheets | [`file`] |

mod draws;
pub mod file;
mod npy;
mod npz;
mod parts;
mod simulator;

pub use draws::{Draw, Draws};
pub use parts::Bank;
pub use simulator::FeatureSimulator;
