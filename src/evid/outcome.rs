//! x
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decision { Named, Class, Partial, NoneOfThese, Absorbed, NotNeeded }
