//! Results that runs at different times share.

use std::fs;
use std::path::Path;

/// A JSON file without its times.
pub fn timeless(path: &Path) -> serde_json::Value {
    fn strip(value: &mut serde_json::Value) {
        match value {
            serde_json::Value::Object(all) => {
                let time = |key: &str| ["ms", "seconds", "seconds_per_record"].contains(&key);
                all.retain(|key, _| !time(key));
                all.values_mut().for_each(strip);
            }
            serde_json::Value::Array(all) => all.iter_mut().for_each(strip),
            _ => {}
        }
    }
    let mut value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
    strip(&mut value);
    value
}
