//! Contents of a folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Every file of a folder and its folders, by the end of its path.
pub fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = PathBuf::from(path.file_name().unwrap());
        match path.is_dir() {
            true => {
                all.extend((files(&path).into_iter()).map(|(end, bytes)| (name.join(end), bytes)))
            }
            false => {
                all.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    all
}
