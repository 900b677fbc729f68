use super::*;

/// Steps that are each near the median, and lead away from one grid, have an oddest one all the same.
#[test]
fn a_grid_that_drifts_has_an_oddest_step() {
    let time = |k: u32| f64::from(k) + 8e-4 * f64::from(k.saturating_sub(100));
    let times: Vec<f64> = (0..200).map(time).collect();
    let drive = Drive::with_times(&times, Signal::zeros((200, 0))).unwrap();
    assert!(!drive.is_uniform() && drive.oddest_step(0.1).is_some());
    let even = Drive::autonomous(0.1, 200).unwrap();
    assert_eq!(even.oddest_step(0.1), None);
}

#[test]
fn sizes_that_cannot_be_squared_are_refused_infinite_ones_too() {
    let check = |value| check_sizes(&Signal::from_elem((2, 1), value), "output", &[]);
    for size in [1e101, f64::NEG_INFINITY, 1e-101] {
        assert!(matches!(check(size), Err(RecordError::Size { name, .. }) if name == "1"));
    }
    assert!(check(0.0).is_ok() && check(-3.0).is_ok());
}

#[test]
fn rows_are_slices_whatever_the_layout_was() {
    let inputs = Signal::from_shape_fn((3, 2), |(k, j)| (10 * k + j) as f64);
    let columns_first = inputs.t().as_standard_layout().into_owned().reversed_axes();
    let drive = Drive::new(0.1, columns_first).unwrap();
    assert_eq!(drive.input(2), [20.0, 21.0]);
}

#[test]
fn steps_may_vary() {
    let drive = Drive::with_times(&[5.0, 5.1, 5.4, 5.5], Signal::zeros((4, 0))).unwrap();
    assert!(!drive.is_uniform());
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    for (k, step) in [0.1, 0.3, 0.1, 0.1].into_iter().enumerate() {
        near(drive.step(k), step);
    }
    for (k, time) in [0.0, 0.1, 0.4, 0.5, 0.6, 0.7].into_iter().enumerate() {
        near(drive.time(k), time);
    }
    let even = Drive::with_times(&[1.0, 1.25, 1.5], Signal::ones((3, 1))).unwrap();
    let expected = Drive::new(0.25, Signal::ones((3, 1))).unwrap();
    assert_ne!(even, expected);
    assert_eq!(even, expected.beginning_at(1.0));
    assert_eq!((drive.own_time(2), drive.own_time(3)), (5.4, 5.5));
    near(drive.own_time(4), 5.6);
    let later = drive.clone().beginning_at(7.0);
    near(later.own_time(2), 7.4);
    near(later.step(1), 0.3);
    assert_eq!(later.first(2).first_time(), 7.0);
    let other = drive.with_inputs(Signal::ones((4, 1))).unwrap();
    assert_eq!((other.time(2), other.input(3)), (drive.time(2), &[1.0][..]));
    assert!(drive.with_inputs(Signal::ones((5, 1))).is_err());
    for times in [
        [0.0, 1.0, 0.5],
        [0.0, f64::NAN, 2.0],
        [0.0, 1.0, f64::INFINITY],
    ] {
        let error = Drive::with_times(&times, Signal::zeros((3, 0))).unwrap_err();
        assert!(error.to_string().contains("time must increase"), "{error}");
    }
    let fine: Vec<f64> = (0..9).map(|k| 1.7e9 + 1e-7 * f64::from(k)).collect();
    let error = Drive::with_times(&fine, Signal::zeros((9, 0))).unwrap_err();
    assert!(matches!(error, RecordError::Resolution { .. }), "{error}");
    let error = Drive::with_times(&[1.0; 3], Signal::zeros((3, 0))).unwrap_err();
    assert!(error.to_string().contains("at least two times"), "{error}");
}

/// Rows of one time are readings of one state, on which no other input acts.
#[test]
fn rows_of_one_time_are_replicates() {
    let times = [3.0, 3.0, 3.5, 3.5, 3.5, 4.0];
    let mut inputs = Signal::from_shape_fn((6, 1), |(k, _)| times[k]);
    let drive = Drive::with_times(&times, inputs.clone()).unwrap();
    assert_eq!((drive.dt(), drive.replicates()), (0.5, 3));
    assert!(!drive.is_uniform());
    let repeated: Vec<bool> = (0..6).map(|k| drive.is_repeated(k)).collect();
    assert_eq!(repeated, [true, false, true, true, false, false]);
    inputs[[4, 0]] = 9.0;
    let error = Drive::with_times(&times, inputs).unwrap_err().to_string();
    let expected = "input 1 is 9, and 3.5 in the row before, which has the same time;";
    assert!(error.starts_with(expected), "{error}");
    let late = drive.late(0.2, [true]).unwrap();
    let of_one_time = |k: &usize| drive.is_repeated(*k);
    assert!(
        (0..drive.samples())
            .filter(of_one_time)
            .all(|k| late.input(k) == late.input(k + 1))
    );
    // A dose of 8 at 3 s, 0.75 s later: half of it at 3.5 s, half at 4 s.
    let late = drive.delayed_amounts(ndarray::aview1(&[8.0, 8.0, 0.0, 0.0, 0.0, 0.0]), 0.75);
    assert_eq!(late.to_vec(), [0.0, 0.0, 4.0, 4.0, 4.0, 4.0]);
}

/// Half a second later, a step has the mean of what is held over it.
#[test]
fn held_inputs_are_late_by_seconds() {
    let inputs = Signal::from_shape_vec((4, 1), vec![1.0, 2.0, 3.0, 4.0]).unwrap();
    let drive = Drive::with_times(&[0.0, 1.0, 3.0, 4.0], inputs).unwrap();
    let late = |is_held| drive.late(0.5, [is_held]).unwrap().inputs().clone();
    assert_eq!(
        late(true).into_raw_vec_and_offset().0,
        [1.0, 1.75, 2.5, 3.5]
    );
    assert_eq!(
        late(false).into_raw_vec_and_offset().0,
        [1.0, 1.5, 2.75, 3.5]
    );
}

#[test]
fn bad_drives_are_refused() {
    let error = |dt, samples| Drive::autonomous(dt, samples).unwrap_err();
    assert!(matches!(error(0.0, 3), RecordError::Step(0.0)));
    let message = error(5e-312, 3).to_string();
    assert!(message.starts_with("step = 5e-312 s; choose"), "{message}");
    assert!(matches!(error(0.1, 0), RecordError::Empty));
    let mut inputs = Signal::zeros((3, 1));
    inputs[[1, 0]] = f64::NAN;
    let error = Drive::new(0.1, inputs).unwrap_err().to_string();
    assert!(error.starts_with("input 1, sample 1"), "{error}");
}
