//! truetwin
pub mod progress;
pub mod twin;
pub mod twins;
