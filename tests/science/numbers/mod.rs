//! Numbers as people have them: parameters and signals of any magnitude, long records, many parameters and outputs.

mod chain;
mod magnitudes;
mod odd;
mod sizes;
