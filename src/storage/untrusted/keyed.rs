//! Tables and objects by their keys alone: the reader that is derived for a type takes a list of its values, too.

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde::forward_to_deserialize_any;
use std::fmt;

/// A value of a type with keys, read from a table or an object; a list is refused in the words that the type expects.
pub(crate) struct Keyed<T>(pub T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Keyed<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        T::deserialize(NoList(from)).map(Self)
    }
}

/// Reads a key's value as [`Keyed`].
pub(crate) fn keyed<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<T, D::Error> {
    Keyed::deserialize(from).map(|Keyed(value)| value)
}

/// Reads a list whose values are [`Keyed`].
pub(crate) fn all_keyed<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    let all = Vec::<Keyed<T>>::deserialize(from)?;
    Ok(all.into_iter().map(|Keyed(value)| value).collect())
}

/// Hands a list to no reader of a type with keys.
struct NoList<D>(D);

impl<'de, D: Deserializer<'de>> Deserializer<'de> for NoList<D> {
    type Error = D::Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, D::Error> {
        self.0.deserialize_any(visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        keys: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_struct(name, keys, KeysOnly(visitor))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct newtype_struct seq
        tuple tuple_struct map enum identifier ignored_any
    }
}

/// A visitor of keys and their values alone.
struct KeysOnly<V>(V);

impl<'de, V: Visitor<'de>> Visitor<'de> for KeysOnly<V> {
    type Value = V::Value;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.expecting(to)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<V::Value, A::Error> {
        self.0.visit_map(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq, serde::Deserialize)]
    #[serde(deny_unknown_fields, expecting = "an object with a")]
    struct Sample {
        a: f64,
        b: Option<[f64; 2]>,
    }

    #[derive(Debug, PartialEq, serde::Deserialize)]
    struct Samples {
        #[serde(deserialize_with = "keyed")]
        one: Sample,
        #[serde(default, deserialize_with = "all_keyed")]
        all: Vec<Sample>,
    }

    #[test]
    fn keys_are_read_and_lists_are_not() {
        let read = |text: &str| serde_json::from_str::<Keyed<Samples>>(text).map(|Keyed(s)| s);
        let sample = |b| Sample { a: 1.0, b };
        let text = r#"{"one": {"a": 1}, "all": [{"a": 1, "b": [2, 3]}]}"#;
        let expected = Samples {
            one: sample(None),
            all: vec![sample(Some([2.0, 3.0]))],
        };
        assert_eq!(read(text).unwrap(), expected);
        assert_eq!(read(r#"{"one": {"a": 1}}"#).unwrap().all, []);
        for (text, part) in [
            (r#"{"one": [1, null]}"#, "expected an object with a"),
            (
                r#"{"one": {"a": 1}, "all": [[1, null]]}"#,
                "expected an object with a",
            ),
            (r#"[{"a": 1}, []]"#, "expected struct Samples"),
            (
                r#"{"one": {"a": 1, "c": 2}}"#,
                "unknown field `c`, expected `a` or `b`",
            ),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(part), "{error}");
        }
        let table = "[[all]]\na = 1.0\n[one]\na = 1.0\n";
        assert!(toml::from_str::<Samples>(table).is_ok());
        let error = toml::from_str::<Samples>("one = [1.0]").unwrap_err();
        assert_eq!(error.span().map(|span| span.start), Some(6), "{error}");
    }
}
