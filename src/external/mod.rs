//! Twins that live outside of this process or of Rust.
//!
//! | the simulator is … | look at |
//! |---|---|
//! | a program in any language that reads and writes lines | [`program`] |
//! | an FMU (FMI 2.0 or 3.0, co-simulation) | `fmu`, of the cargo feature `fmi` |

#[cfg(feature = "fmi")]
pub mod fmu;
mod lending;
mod name;
pub mod program;
