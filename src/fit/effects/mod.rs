//! Effects in a fit.
//!
//! | file | question |
//! |---|---|
//! | `search.rs` | searches without and with the effects of a study |
//! | `magnitude.rs` | how large an effect may be, and where a threshold, a lag or a time may lie |
//! | `beginnings.rs` | where a search for magnitudes begins |

mod beginnings;
pub(crate) mod magnitude;
pub(super) mod search;
