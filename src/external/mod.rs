//! Twins that live outside of this process or of Rust.
//!
//! | the simulator is … | look at |
//! |---|---|
//! | a program in any language that reads and writes lines | [`program`] |

mod name;
pub mod program;
