//! The house: rooms and their order, counts that must not grow, dependencies, metadata, README and book.

mod book;
mod cycles;
mod dependencies;
mod layering;
mod metadata;
mod public_api;
mod ratchets;
mod readme;
mod source;
