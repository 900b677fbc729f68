//! Hostile files and places: readers, limits, full disks, signals, security. Every allocation of this binary is counted.

mod allocations;
mod calls;
#[cfg(target_os = "linux")]
mod faults;
#[path = "../common/files.rs"]
mod files;
mod fuzz;
mod list;
mod memory;
#[cfg(target_os = "linux")]
mod mixed;
mod numbers;
#[cfg(unix)]
mod places;
mod security;
#[cfg(unix)]
mod signals;
#[cfg(unix)]
mod stop;
#[path = "../common/studies.rs"]
mod studies;
#[path = "../common/timeless.rs"]
mod timeless;
mod versions;
mod words;
