//! Columns of text.

/// Between columns.
const GAP: &str = "   ";

/// Rows as lines: the first column begins at the left, the others end at the right. Rows have one length.
pub(super) fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let length = |row: &Vec<String>, j: usize| row.get(j).map_or(0, |cell| cell.chars().count());
    let widths: Vec<usize> = (0..columns)
        .map(|j| rows.iter().map(|row| length(row, j)).max().unwrap_or(0))
        .collect();
    let mut text = String::new();
    for row in rows {
        let cells: Vec<String> = (row.iter().zip(&widths).enumerate())
            .map(|(j, (cell, &width))| match j {
                0 => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            })
            .collect();
        text.push_str(cells.join(GAP).trim_end());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [["method", "k4·k2²"], ["GN", "1.2"]].map(|r| r.map(String::from).to_vec());
        assert_eq!(table(&rows), "method   k4·k2²\nGN          1.2\n");
        assert_eq!(table(&[]), "");
    }
}
