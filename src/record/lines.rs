//! Lines of a file that the rows of a record stand in.

use std::sync::Arc;

/// Line of each sample in the file of its record, as an editor counts lines: the header is line 1, the first sample line 2, unless there
/// are empty lines or cells of several lines.
#[derive(Debug, Clone, Default)]
pub(crate) struct FileLines(Option<Arc<[(usize, usize)]>>);

impl FileLines {
    /// Lines of a file. From each sample that is named on, so many more lines stand before a sample than samples do.
    pub(super) fn of(surplus: Vec<(usize, usize)>) -> Self {
        Self((!surplus.is_empty()).then(|| surplus.into()))
    }

    /// Returns the line of a sample.
    pub fn line(&self, sample: usize) -> usize {
        let surplus = self.0.as_deref().unwrap_or_default();
        let after = surplus.partition_point(|(first, _)| *first <= sample);
        sample + 2 + surplus[..after].last().map_or(0, |(_, lines)| *lines)
    }
}

/// Where rows stand in a file is no part of what was measured.
impl PartialEq for FileLines {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
