//! Places of samples in the file that they were read from.

use std::sync::Arc;

/// The file that the rows of a record were read from: line of each sample, as an editor counts lines, names of its columns, and whether times
/// were stamps. The header is line 1, the first sample line 2, unless there are empty lines or cells of several lines.
#[derive(Debug, Clone, Default)]
pub(crate) struct FileRows {
    surplus: Option<Arc<[(usize, usize)]>>,
    /// Names of the columns of time, inputs and outputs; usual ones where none are known.
    columns: Option<Arc<[String]>>,
    has_stamps: bool,
}

impl FileRows {
    /// Rows of a file. From each sample that is named on, so many more lines stand before a sample than samples do.
    pub(in crate::record) fn of(
        surplus: Vec<(usize, usize)>,
        columns: &[String],
        has_stamps: bool,
    ) -> Self {
        Self {
            surplus: (!surplus.is_empty()).then(|| surplus.into()),
            columns: Some(columns.into()),
            has_stamps,
        }
    }

    /// Returns the name of the column of a channel, of time, inputs and outputs, and `usual` where the file has none.
    pub fn column(&self, place: usize, usual: impl FnOnce() -> String) -> String {
        let own = (self.columns.as_deref()).and_then(|columns| columns.get(place));
        (own.filter(|own| !own.is_empty()).cloned()).unwrap_or_else(usual)
    }

    /// Returns whether times were stamps, whose unit nobody can mistake.
    pub fn has_stamps(&self) -> bool {
        self.has_stamps
    }

    /// Returns the line of a sample.
    pub fn line(&self, sample: usize) -> usize {
        let surplus = self.surplus.as_deref().unwrap_or_default();
        let after = surplus.partition_point(|(first, _)| *first <= sample);
        sample + 2 + surplus[..after].last().map_or(0, |(_, lines)| *lines)
    }
}

/// The rows of a file are no part of what was measured.
impl PartialEq for FileRows {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
