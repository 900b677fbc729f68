//! Studies that several binaries of tests share.

use std::fs;
use std::path::Path;

/// Puts a study of short records and few effects into a folder, for tests of the order of work; returns its path.
pub fn short(folder: &Path) -> String {
    let path = folder.join("short.toml");
    let study = "twin = 'van-der-pol'\n[record]\nsamples = 100\n\
                 [library]\nonly = ['sensor-bias', 'sensor-gain', 'linear-loss']\n";
    fs::write(&path, study).unwrap();
    path.display().to_string()
}
