//! The house: rooms and their order, dependencies, README and book.

mod book;
mod dependencies;
mod layering;
mod readme;
