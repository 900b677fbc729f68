//! Long lines with few points that look the same.

/// Points of a line that is drawn `columns` columns wide: of each column its lowest and its highest point, in their
/// order, so that peaks stay. A line of at most two points a column is left alone. `points` are sorted by x; a point
/// that is not finite breaks the line and is kept, once a column.
pub(super) fn decimate(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return vec![];
    };
    let columns = columns.max(1);
    if points.len() <= 2 * columns || last.0 <= first.0 {
        return points.to_vec();
    }
    let scale = columns as f64 / (last.0 - first.0);
    let column = |x: f64| (((x - first.0) * scale) as usize).min(columns - 1);
    let mut kept = Vec::with_capacity(2 * columns);
    for group in points.chunk_by(|a, b| column(a.0) == column(b.0)) {
        let finite = || (0..group.len()).filter(|&i| group[i].1.is_finite());
        let low = finite().min_by(|&i, &j| group[i].1.total_cmp(&group[j].1));
        let high = finite().max_by(|&i, &j| group[i].1.total_cmp(&group[j].1));
        let hole = group.iter().position(|p| !p.1.is_finite());
        let mut chosen: Vec<usize> = [low, high, hole].into_iter().flatten().collect();
        chosen.sort_unstable();
        chosen.dedup();
        kept.extend(chosen.into_iter().map(|i| group[i]));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_survive_and_short_lines_stay() {
        let mut points: Vec<(f64, f64)> =
            (0..50_000).map(|k| (k as f64, (k as f64).sin())).collect();
        points[12_345].1 = 9.0;
        points[40_000].1 = -7.0;
        let few = decimate(&points, 300);
        assert!(few.len() <= 600);
        assert!(few.contains(&(12_345.0, 9.0)) && few.contains(&(40_000.0, -7.0)));
        assert!(few.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(decimate(&points[..600], 300), points[..600]);
    }

    #[test]
    fn a_hole_stays_a_hole() {
        let line = (0..1000).map(|k| (k as f64, if k == 500 { f64::NAN } else { 1.0 }));
        let few = decimate(&line.collect::<Vec<_>>(), 10);
        assert_eq!(few.iter().filter(|p| p.1.is_nan()).count(), 1);
        assert_eq!(decimate(&[], 10), []);
    }
}
