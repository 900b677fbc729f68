//! Twins as text: equations in a file, without a compiler.
//!
//! ```toml
//! [twin]
//! name = "pendulum"
//! [parameters]
//! l = { unit = "m", prior = [0.5, 2.0], bounds = [0.1, 5.0] }
//! [states]
//! q = { unit = "rad", rate = "v", start = 0.3 }
//! v = { unit = "rad/s", rate = "-9.81/l * sin(q) + u" }
//! [inputs]
//! u = { unit = "1/s2" }
//! [outputs]
//! y = { unit = "rad", value = "q", noise = 0.02 }
//! ```
//!
//! A text is read once. Its expressions become one straight list of operations over blocks of points: a filter's points of a step go
//! through each operation together, so that a text costs a filter what compiled equations do. Nothing but arithmetic is ever done.
//!
//! | step | file |
//! |---|---|
//! | tables of the file, their keys and places | `file.rs`, `place.rs`, `entries.rs`; written again: `written.rs` |
//! | words and signs of an expression; its operations in order | `expression/` |
//! | names, definitions, common parts, constants | `names.rs`, `graph.rs` |
//! | operations over blocks | `tape/` |
//! | times at which rates jump | `jumps.rs` |
//! | events: their conditions, times and changes | `event/` |
//! | the equations that they are | `program.rs` |
//! | the twin | `twin.rs`, `declared.rs` |

mod declared;
mod entries;
mod error;
mod event;
mod expression;
mod file;
mod graph;
mod jumps;
mod names;
mod place;
mod program;
mod tape;
#[cfg(test)]
mod tests;
mod twin;
mod written;

pub(crate) use declared::Declared;
pub use error::EquationsError;
pub(crate) use file::take;
pub(crate) use program::Program;
pub use twin::Equations;
pub(crate) use written::TABLES;
