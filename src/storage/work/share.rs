//! Shares of numbered work.

use crate::storage::StorageError;
use std::str::FromStr;

/// Share `index` of `of`: it has piece k if k ≡ index (mod of).
///
/// Written `i/n`. Job arrays may count from 0 or from 1: 0/n is n/n.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    index: usize,
    of: usize,
}

impl Share {
    /// Everything.
    pub const WHOLE: Self = Self { index: 0, of: 1 };

    /// Creates share `index` (from 0, or from 1) of `of`.
    pub fn new(index: usize, of: usize) -> Result<Self, StorageError> {
        if of == 0 || index > of {
            return Err(StorageError::Share(format!("{index}/{of}")));
        }
        Ok(Self {
            index: index % of,
            of,
        })
    }

    /// Tells whether the share has piece `number`.
    pub fn takes(self, number: usize) -> bool {
        number % self.of == self.index
    }

    /// Tells whether the share is everything.
    pub fn is_whole(self) -> bool {
        self.of == 1
    }
}

impl FromStr for Share {
    type Err = StorageError;

    fn from_str(text: &str) -> Result<Self, StorageError> {
        let wrong = || StorageError::Share(text.into());
        let (index, of) = text.split_once('/').ok_or_else(wrong)?;
        let number = |digits: &str| digits.parse().map_err(|_| wrong());
        Self::new(number(index)?, number(of)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counted from 0 or from 1: every piece belongs to exactly one share.
    #[test]
    fn shares_are_a_partition_however_they_are_counted() {
        for first in [0, 1] {
            let shares: Vec<Share> = (first..first + 4)
                .map(|i| format!("{i}/4").parse().unwrap())
                .collect();
            for k in 0..50 {
                assert_eq!(shares.iter().filter(|s| s.takes(k)).count(), 1);
            }
        }
        assert!(Share::WHOLE.is_whole() && Share::WHOLE.takes(7));
    }

    #[test]
    fn other_texts_are_refused() {
        for text in [
            "", "3", "5/4", "1/0", "0/0", "-1/4", "a/b", "1/2/3", "1.0/2",
        ] {
            let error = text.parse::<Share>().unwrap_err().to_string();
            assert!(error.contains("such as 1/4"), "{error}");
        }
    }
}
