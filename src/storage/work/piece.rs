//! The text of a piece of work: a JSON object with its checksum, which covers the piece and the call that it belongs to.

use crate::storage::checksum::sha256;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Key of the checksum.
const KEY: &str = "sha256";

fn checksum(piece: &Map<String, Value>, identity: &str) -> String {
    // A map of values has one text.
    let text = Value::Object(piece.clone()).to_string();
    sha256(format!("{identity}\n{text}").as_bytes())
}

/// Returns the text of a piece, an object, of the call with this identity.
pub(super) fn text<T: Serialize>(piece: &T, identity: &str) -> Result<String, serde_json::Error> {
    // Parsed, numbers are those that a reader will see.
    let mut piece: Map<String, Value> = serde_json::from_str(&serde_json::to_string(piece)?)?;
    let sum = checksum(&piece, identity);
    piece.insert(KEY.into(), sum.into());
    Ok(format!("{:#}\n", Value::Object(piece)))
}

/// Parses a piece of the call with this identity; one that was altered, or that is another call's, is refused.
pub(super) fn parse<T: DeserializeOwned>(text: &str, identity: &str) -> Result<T, String> {
    let mut piece: Map<String, Value> =
        serde_json::from_str(text).map_err(|error| error.to_string())?;
    let sum = piece.shift_remove(KEY).ok_or("it has no checksum")?;
    if sum != checksum(&piece, identity).as_str() {
        return Err(
            "it does not match its checksum: it was altered, or belongs to another call".into(),
        );
    }
    serde_json::from_value(Value::Object(piece)).map_err(|error| error.to_string())
}
