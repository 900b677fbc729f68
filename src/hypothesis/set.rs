//! A set of terms by their keys.

use super::term::Term;
use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

/// Keys of terms, in order: what a set of hypotheses is called, whatever the order in which its terms were found.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct TermSet(BTreeSet<String>);

impl TermSet {
    /// Returns the set of these terms.
    pub fn of(terms: &[Arc<Term>]) -> Self {
        terms.iter().map(|term| term.key()).collect()
    }

    /// Keys in order.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(String::as_str)
    }
}

impl FromIterator<String> for TermSet {
    fn from_iter<I: IntoIterator<Item = String>>(keys: I) -> Self {
        Self(keys.into_iter().collect())
    }
}

impl fmt::Display for TermSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, key) in self.iter().enumerate() {
            if i > 0 {
                f.write_str(" + ")?;
            }
            f.write_str(key)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_one_name() {
        let set = |keys: &[&str]| -> TermSet { keys.iter().map(|k| (*k).to_owned()).collect() };
        let (one, other) = (set(&["b@y", "a@x"]), set(&["a@x", "b@y", "b@y"]));
        assert_eq!(one, other);
        assert_eq!(one.to_string(), "a@x + b@y");
        assert!(set(&["a@x"]) < one);
    }
}
