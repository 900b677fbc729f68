//! Rounded values.

/// Samples for each multiple of the step within the signal's range, at least, where the step is one of digits: files round, too.
const REPEATS: f64 = 2.0;
/// Readings, and distinct values where none repeats, that tell a step from chance.
const ENOUGH: usize = 8;
/// Largest distance of a rounded value from a multiple of the step, in steps.
const TOLERANCE: f64 = 0.01;

/// Distinct values and how often each comes, ascending.
pub(crate) fn distinct(outputs: &[f64]) -> Vec<(f64, usize)> {
    let mut sorted: Vec<f64> = (outputs.iter().copied())
        .filter(|v| v.is_finite())
        .collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let span = match (sorted.first(), sorted.last()) {
        (Some(low), Some(high)) => high - low,
        _ => 0.0,
    };
    let mut values: Vec<(f64, usize)> = Vec::new();
    for v in sorted {
        match values.last_mut() {
            Some((last, count)) if v - *last <= 1e-9 * span => *count += 1,
            _ => values.push((v, 1)),
        }
    }
    values
}

/// Step of rounded values: all distances are multiples of the least one, and there are few values, which repeat, or the step is none of digits. Missing
/// values tell nothing.
pub(crate) fn step_of(outputs: &[f64]) -> Option<f64> {
    let values = distinct(outputs);
    let readings: usize = values.iter().map(|(_, count)| count).sum();
    if values.len() < 2 {
        return None;
    }
    let step = (values.windows(2))
        .map(|w| w[1].0 - w[0].0)
        .fold(f64::INFINITY, f64::min);
    let span = values[values.len() - 1].0 - values[0].0;
    let steps = (span / step).round();
    // All of them know the step better than two.
    let step = span / steps;
    let fine = REPEATS * steps > readings as f64;
    if readings < ENOUGH || fine && (values.len() < ENOUGH || is_of_digits(step)) {
        return None;
    }
    let low = values[0].0;
    let off = |v: f64| {
        let level = (v - low) / step;
        (level - level.round()).abs()
    };
    (values.iter().all(|(v, _)| off(*v) <= TOLERANCE)).then_some(step)
}

/// Returns whether the step is one that numbers have in files and machines: a power of ten or of two, or ten over two, four, five.
fn is_of_digits(step: f64) -> bool {
    let whole = |v: f64| (v - v.round()).abs() < 1e-4;
    [1.0, 2.0, 2.5, 5.0]
        .iter()
        .any(|first| whole((step / first).log10()))
        || whole(step.log2())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_found_where_values_repeat_or_it_is_none_of_digits() {
        let wave = |round: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..300)
                .map(|k| round((0.7 * f64::from(k)).sin()))
                .collect()
        };
        let near = |found: Option<f64>, step: f64| (found.unwrap() - step).abs() < 1e-9 * step;
        assert!(near(step_of(&wave(&|v| (v / 0.3).round() * 0.3)), 0.3));
        assert!(near(
            step_of(&wave(&|v| ((v / 0.0031).floor() + 0.5) * 0.0031)),
            0.0031
        ));
        assert_eq!(step_of(&wave(&|v| v)), None);
        assert_eq!(
            step_of(&wave(&|v| (v * 1e4).round() / 1e4)),
            None,
            "digits of a file"
        );
        assert_eq!(step_of(&[1.0; 50]), None);
        assert_eq!(step_of(&[]), None);
        // Two readings are always one step apart, and three of many rows often a multiple.
        for few in [&[0.9895, 0.6367][..], &[0.1, 0.1, 0.5]] {
            assert_eq!(step_of(few), None);
        }
        let mut sparse = vec![f64::NAN; 300];
        (sparse[20], sparse[150], sparse[280]) = (0.25, 0.75, 2.25);
        assert_eq!(step_of(&sparse), None);
    }
}
