//! Reference twins, in the setting of the paper. They use nothing that a user's twin could not.

mod cascaded_tanks;
mod van_der_pol;

pub use cascaded_tanks::CascadedTanks;
pub use van_der_pol::VanDerPol;

/// [`CascadedTanks`] as text; a test compares both.
pub(crate) const TANKS: &str = include_str!("../../examples/tanks.toml");
/// [`VanDerPol`] as text; a test compares both.
pub(crate) const VAN_DER_POL: &str = include_str!("../../examples/van-der-pol.toml");
