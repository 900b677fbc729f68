//! A record on another time grid, of one step.

use super::table::MOST_SAMPLES;
use crate::math::three_digits;
use crate::record::{Drive, Record, RecordError, Signal, UNIFORM, check_sizes};
use crate::setting::{count, number};
use crate::storage::untrusted::MOST_NUMBERS;

/// Share of a step within which two instants are the same: that of uniform steps.
const SAME: f64 = 1e-3;
/// Longest gap that is closed unless said otherwise, in steps between the measured outputs on both sides: three missing samples. A
/// straight line over more may miss a motion of the system.
pub(crate) const CLOSED_STEPS: f64 = 4.0;

/// Inputs of a new step, made from those held over the old ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputRule {
    /// Mean over the step.
    Mean,
    /// The input that acts when the step begins.
    Hold,
}

/// A resampled record.
#[derive(Debug)]
pub struct Resampled {
    /// The record on the new grid.
    pub record: Record,
    /// Outputs that lie between two measured ones and were interpolated.
    pub interpolated: usize,
    /// Longest time between two measured outputs that is interpolated over, in seconds.
    pub longest_gap: f64,
}

/// Resamples a record to one `step` in seconds, from its first sample on.
///
/// Outputs are interpolated linearly between measured ones that are at most `longest_gap` seconds apart ([`CLOSED_STEPS`] steps, the old
/// or the new ones, if not given). Longer gaps stay empty, and so do samples before the first measured output and after the last.
///
/// # Errors
///
/// [`RecordError`]: a step that is not positive, or that leaves too few or too many samples; a gap that is not positive.
pub fn resample(
    record: &Record,
    step: f64,
    rule: InputRule,
    longest_gap: Option<f64>,
) -> Result<Resampled, RecordError> {
    if !(step > 0.0 && step.is_normal()) {
        return Err(RecordError::Step(step));
    }
    if let Some(gap) = longest_gap.filter(|gap| !(*gap > 0.0 && gap.is_finite())) {
        return Err(RecordError::Resample(format!(
            "a longest gap of {} s; choose a positive number of seconds",
            number(gap)
        )));
    }
    let drive = record.drive();
    check_sizes(drive.inputs(), "input", &[])?;
    check_sizes(record.outputs(), "output", &[])?;
    let (inputs, outputs) = (drive.inputs().ncols(), record.outputs().ncols());
    let length = drive.time(record.samples() - 1);
    let steps = (length / step + SAME).floor();
    let refused = |problem: &str, remedy: &str| {
        Err(RecordError::Resample(format!(
            "a step of {} s leaves {problem} of a record of {} s; {remedy}",
            number(step),
            number(three_digits(length))
        )))
    };
    if steps < 1.0 {
        return refused("1 sample", "choose a shorter step");
    }
    let most = MOST_SAMPLES.min(MOST_NUMBERS / (1 + inputs + outputs));
    if steps >= most as f64 {
        return refused(&format!("more than {most} samples"), "choose a longer step");
    }
    // The last times are written apart, and read as even.
    if (drive.first_time().abs() + length) * f64::EPSILON > UNIFORM * step {
        return refused(
            "rows of one time",
            "choose a longer step, or let time begin at 0",
        );
    }
    let samples = steps as usize + 1;
    let longest_gap = longest_gap.unwrap_or(CLOSED_STEPS * drive.dt().max(step));
    let mut interpolated = 0;
    let mut all = Signal::from_elem((samples, outputs), f64::NAN);
    for (j, mut column) in all.columns_mut().into_iter().enumerate() {
        let measured: Vec<(f64, f64)> = (0..record.samples())
            .map(|k| (drive.time(k), record.outputs()[[k, j]]))
            .filter(|(_, y)| !y.is_nan())
            .collect();
        let measured = without_replicates(&measured);
        let mut next = 0;
        for (k, value) in column.iter_mut().enumerate() {
            let t = k as f64 * step;
            let slack = SAME * step.min(drive.dt());
            while next < measured.len() && measured[next].0 < t - slack {
                next += 1;
            }
            let Some(&(after, y)) = measured.get(next) else {
                break;
            };
            if after <= t + slack {
                *value = y;
            } else if let Some((before, start)) = next.checked_sub(1).map(|i| measured[i])
                && after - before <= longest_gap * (1.0 + SAME)
            {
                interpolated += 1;
                *value = start + (y - start) * (t - before) / (after - before);
            }
        }
    }
    let inputs = resampled_inputs(drive, step, samples, rule);
    let drive = Drive::new(step, inputs)?.beginning_at(drive.first_time());
    let record = match Record::new(drive, all) {
        Err(RecordError::TooFewValues(rows)) => {
            let problem = format!("{} with an output", count(rows, "row"));
            return refused(&problem, "choose a shorter step, or a longer gap to close");
        }
        record => record?,
    };
    Ok(Resampled {
        record,
        interpolated,
        longest_gap,
    })
}

/// Values by time, the mean of those of one time in their place.
fn without_replicates(measured: &[(f64, f64)]) -> Vec<(f64, f64)> {
    (measured.chunk_by(|a, b| a.0 == b.0))
        .map(|group| {
            let sum: f64 = group.iter().map(|(_, y)| y).sum();
            (group[0].0, sum / group.len() as f64)
        })
        .collect()
}

fn resampled_inputs(drive: &Drive, step: f64, samples: usize, rule: InputRule) -> Signal {
    let mut inputs = Signal::zeros((samples, drive.inputs().ncols()));
    let last = drive.samples() - 1;
    let mut acting = 0;
    for (k, mut row) in inputs.rows_mut().into_iter().enumerate() {
        let (start, end) = (k as f64 * step, (k + 1) as f64 * step);
        while acting < last && drive.time(acting + 1) <= start + SAME * step.min(drive.dt()) {
            acting += 1;
        }
        if rule == InputRule::Hold {
            row.assign(&drive.inputs().row(acting));
            continue;
        }
        // The last input is held beyond the record.
        let (mut i, mut from) = (acting, start);
        while from < end {
            let until = match i < last {
                true => drive.time(i + 1).min(end),
                false => end,
            };
            let share = (until - from).max(0.0) / step;
            row.scaled_add(share, &drive.inputs().row(i));
            (from, i) = (until.max(from), i + 1);
            if i > last {
                break;
            }
        }
    }
    inputs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(times: &[f64], u: &[f64], y: &[f64]) -> Record {
        let column = |values: &[f64]| Signal::from_shape_vec((values.len(), 1), values.to_vec());
        let drive = Drive::with_times(times, column(u).unwrap()).unwrap();
        Record::new(drive, column(y).unwrap()).unwrap()
    }

    fn column(signal: &Signal) -> Vec<f64> {
        signal.iter().map(|v| (v * 1e9).round() / 1e9).collect()
    }

    #[test]
    fn inputs_are_averaged_or_held_and_outputs_interpolated() {
        let uneven = record(
            &[3.0, 4.0, 5.5, 6.0],
            &[1.0, 2.0, 4.0, 8.0],
            &[0.0, 1.0, 4.0, 5.0],
        );
        let even = resample(&uneven, 1.0, InputRule::Mean, Some(1.0)).unwrap();
        assert_eq!(column(even.record.drive().inputs()), [1.0, 2.0, 3.0, 8.0]);
        assert_eq!(
            even.record.outputs().iter().filter(|y| y.is_nan()).count(),
            1,
            "a gap of 1.5 s"
        );
        let held = resample(&uneven, 1.5, InputRule::Hold, None)
            .unwrap()
            .record;
        assert_eq!(column(held.drive().inputs()), [1.0, 2.0, 8.0]);
        assert_eq!(column(held.outputs()), [0.0, 2.0, 5.0]);
        assert!(held.drive().is_uniform());
    }

    #[test]
    fn a_record_on_its_own_grid_stays_as_it_is() {
        let nan = f64::NAN;
        let times: Vec<f64> = (0..5).map(|k| 0.1 * f64::from(k)).collect();
        let own = record(
            &times,
            &[1.0, 2.0, 3.0, 4.0, 5.0],
            &[0.0, 0.1, nan, 0.3, 0.4],
        );
        for rule in [InputRule::Mean, InputRule::Hold] {
            let same = resample(&own, 0.1, rule, Some(0.1)).unwrap();
            assert_eq!(
                column(same.record.drive().inputs()),
                [1.0, 2.0, 3.0, 4.0, 5.0]
            );
            assert_eq!((same.record.missing(), same.interpolated), (1, 0));
        }
        let coarse = resample(&own, 0.2, InputRule::Mean, None).unwrap();
        assert_eq!(column(coarse.record.drive().inputs()), [1.5, 3.5, 5.0]);
        assert_eq!(column(coarse.record.outputs()), [0.0, 0.2, 0.4]);
        let fine = resample(&own, 0.05, InputRule::Mean, Some(0.1));
        let fine = fine.unwrap().record;
        assert_eq!((fine.samples(), fine.missing()), (9, 3));
    }

    /// One to three missing samples are closed on the record's own grid; four are not, unless asked for; ends never.
    #[test]
    fn short_gaps_are_closed() {
        let nan = f64::NAN;
        let y = [
            nan, 0.1, nan, 0.3, nan, nan, nan, 0.7, nan, nan, nan, nan, 1.2, nan,
        ];
        let times: Vec<f64> = (0..14).map(|k| 0.1 * f64::from(k)).collect();
        let own = record(&times, &[0.0; 14], &y);
        let missing = |gap| resample(&own, 0.1, InputRule::Mean, gap).unwrap();
        let closed = missing(None);
        assert_eq!((closed.interpolated, closed.record.missing()), (4, 6));
        let line: Vec<f64> = closed.record.outputs().iter().copied().collect();
        assert!((line[5] - 0.5).abs() < 1e-12 && line[8].is_nan());
        assert!((closed.longest_gap - 0.4).abs() < 1e-12);
        assert_eq!(missing(Some(0.5)).record.missing(), 2);
        assert_eq!(missing(Some(0.3)).interpolated, 1);
        for gap in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let refused = resample(&own, 0.1, InputRule::Mean, Some(gap)).unwrap_err();
            assert!(refused.to_string().contains("choose a positive number"));
        }
    }

    #[test]
    fn steps_that_leave_no_record_are_refused() {
        let short = record(&[0.0, 1.0, 2.0], &[0.0; 3], &[0.0, 1.0, 2.0]);
        for (step, part) in [
            (0.0, "choose a positive number"),
            (f64::NAN, "choose a positive number"),
            (
                5.0,
                "a step of 5 s leaves 1 sample of a record of 2 s; choose a shorter step",
            ),
            (1e-12, "choose a longer step"),
        ] {
            let error = resample(&short, step, InputRule::Mean, None)
                .unwrap_err()
                .to_string();
            assert!(error.contains(part), "{error}");
        }
        let late = Record::new(
            short.drive().clone().beginning_at(1.7e9),
            short.outputs().clone(),
        );
        let error = resample(&late.unwrap(), 1e-5, InputRule::Mean, None).unwrap_err();
        assert!(
            error.to_string().contains("leaves rows of one time"),
            "{error}"
        );
    }
}
