//! The trajectories behind the overlay, as a table.

use crate::record::{Record, Signal};

/// CSV with a row a sample: `t`, then for each output what was measured, and what the twin shows without noise before
/// (where it is given) and after calibration: `y`, `before`, `after`, numbered where there are several outputs.
pub fn trajectories_csv(record: &Record, before: Option<&Signal>, after: &Signal) -> String {
    let outputs = record.outputs();
    let named = |word: &str, j: usize| match outputs.ncols() {
        1 => word.to_owned(),
        _ => format!("{word}{}", j + 1),
    };
    let mut columns = Vec::new();
    for j in 0..outputs.ncols() {
        columns.push((named("y", j), outputs.column(j)));
        if let Some(before) = before {
            columns.push((named("before", j), before.column(j)));
        }
        columns.push((named("after", j), after.column(j)));
    }
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = format!("t,{}\n", names.join(","));
    for k in 0..record.samples() {
        text.push_str(&format!("{:.9}", record.drive().time(k)));
        for (_, column) in &columns {
            text.push_str(&format!(",{}", column[k]));
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Drive;

    #[test]
    fn one_column_a_line_of_the_picture() {
        let drive = Drive::autonomous(0.5, 2).unwrap();
        let signal = |v: f64| Signal::from_elem((2, 2), v);
        let record = Record::new(drive, signal(1.0)).unwrap();
        let text = trajectories_csv(&record, Some(&signal(2.0)), &signal(3.0));
        assert_eq!(
            text.lines().next(),
            Some("t,y1,before1,after1,y2,before2,after2")
        );
        assert_eq!(text.lines().nth(2), Some("0.500000000,1,2,3,1,2,3"));
        assert!(trajectories_csv(&record, None, &signal(3.0)).starts_with("t,y1,after1,"));
    }
}
