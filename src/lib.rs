//! truetwin
pub mod bank;
pub mod feature;
pub mod gate;
pub mod math;
pub mod network;
pub mod optimise;
pub mod progress;
pub mod refine;
pub mod sample;
pub mod study;
pub mod twin;
pub mod twins;
pub mod two_stage;
