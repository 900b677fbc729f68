//! Where in time, at which states, inputs and outputs, after which lags and at which frequencies the twin does not follow.
//!
//! | step | file |
//! |---|---|
//! | how records are cut | `cut.rs` |
//! | how little the innovations of each cut look like white noise | `look.rs` |
//! | what each cut holds of the whole | `shares.rs` |

mod cut;
mod look;
mod shares;

pub(super) use cut::{Bins, Cut, Past, edges};
pub(super) use look::{level, local};
pub(super) use shares::shares;
