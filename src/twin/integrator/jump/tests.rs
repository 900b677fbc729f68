use super::{JumpsSeen, Path, Stretch, step_with_jumps};
use crate::twin::integrator::{Integrator, Now, Stepping, Workspace};
use crate::twin::{Interval, Noise};

/// Points carried over so many rows of 1 s.
fn carried<const N: usize>(
    rule: Integrator,
    points: &[[f64; N]],
    rows: usize,
    rates: impl Fn(f64, &[f64], &mut [f64]),
) -> Vec<f64> {
    let mut work = Workspace::of(
        &[],
        &[Interval::EVERYTHING; N],
        (rule, Stepping::default()),
        &[],
    );
    let mut x = points.concat();
    for k in 0..rows {
        let now = Now::new(k as f64, 1.0, &[], &[]);
        work.carry(N, &now, &mut x, |now, x, dx| {
            for (x, dx) in x.chunks_exact(N).zip(dx.chunks_exact_mut(N)) {
                rates(now.t, x, dx);
            }
        });
    }
    x
}

/// One step of a point.
fn stepped<const N: usize>(
    h: f64,
    begin: [f64; N],
    mut rates: impl FnMut(f64, &[f64], &mut [f64]),
) -> [f64; N] {
    let now = Now::new(0.0, h, &[], &[]);
    let mut path = Path {
        now: &now,
        inputs: &mut [],
        drift: &mut |now, x, dx| rates(now.t, x, dx),
        breaks: &[],
        edge: 0.0,
        limits: None,
        held: vec![],
    };
    let mut x = begin;
    let of = Stretch {
        from: 0.0,
        length: 1.0,
    };
    let mut seen = JumpsSeen::default();
    step_with_jumps(&mut path, of, (N, &mut x, &mut seen), None);
    x
}

/// Where a step of 0.125 s ends is continuous in where it begins, and off by less than four squares of it: a sled that friction stops or lets through,
/// a spring that is met, and friction beside a damping that changes the rate by more.
#[test]
fn a_step_past_a_jump_is_continuous_in_its_begin() {
    type Rates = fn(f64, &[f64], &mut [f64]);
    let systems: [(&str, [f64; 2], [f64; 2], Rates); 4] = [
        ("sled at rest", [0.0, -0.2], [0.0, 0.2], |_, x, dx| {
            (dx[0], dx[1]) = (x[1], 0.2 - 0.7 * sign(x[1]));
        }),
        ("sled", [0.0, -0.4], [0.0, 0.4], |_, x, dx| {
            (dx[0], dx[1]) = (x[1], 2.0 - 0.6 * sign(x[1]));
        }),
        ("spring", [0.9, 1.0], [1.1, 1.0], |_, x, dx| {
            let spring = if x[0] > 1.0 { 4.0 } else { 0.0 };
            (dx[0], dx[1]) = (x[1], -1.0 - spring);
        }),
        ("damped", [0.0, -0.2], [0.0, 0.2], |_, x, dx| {
            (dx[0], dx[1]) = (x[1], 0.9 - x[1] - 0.1 * sign(x[1]));
        }),
    ];
    let h = 0.125;
    for (name, from, to, rates) in systems {
        let mut last: Option<[f64; 2]> = None;
        for k in 0..=4000 {
            let share = f64::from(k) / 4000.0;
            let begin = [0, 1].map(|i: usize| from[i] + share * (to[i] - from[i]));
            let end = stepped(h, begin, rates);
            let (mut exact, short) = (begin, h / 2000.0);
            for _ in 0..if k % 40 == 0 { 2000 } else { 0 } {
                let mut dx = [0.0; 2];
                rates(0.0, &exact, &mut dx);
                (0..2).for_each(|i| exact[i] += short * dx[i]);
            }
            for i in 0..2 {
                let off = (end[i] - exact[i]).abs();
                assert!(
                    k % 40 > 0 || off < 4.0 * h * h,
                    "{name} {begin:?}: {end:?} {exact:?}"
                );
                let leap = last.map_or(0.0, |last| (end[i] - last[i]).abs());
                assert!(leap < 2e-3, "{name} {begin:?}: {i} leaps by {leap}");
            }
            last = Some(end);
        }
    }
}

/// Rubbing blocks, friction beside damping and a relay between two levels, from 3000 starts each: no step goes farther than the rates on it allow.
#[test]
fn no_step_goes_farther_than_its_rates() {
    type Rates = fn(f64, &[f64], &mut [f64]);
    let systems: [(&str, Rates); 4] = [
        ("blocks", |_, x, dx| {
            let between = 0.4 * sign(x[0] - x[1]);
            dx[0] = 0.3 - 0.5 * sign(x[0]) - between;
            dx[1] = between - 0.5 * sign(x[1]);
        }),
        ("two levels", |_, x, dx| {
            dx[0] = 2.0 - 0.6 * sign(x[0]) - 0.6 * sign(x[0] - 5e-5);
            dx[1] = 2.0 - 0.6 * sign(x[1]) - 0.6 * sign(x[1] - 2.5e-4);
        }),
        ("pushed", |_, x, dx| {
            (dx[0], dx[1]) = (x[1] - 0.6 * sign(x[0]), 2.0);
        }),
        ("damped", |_, x, dx| {
            (dx[0], dx[1]) = (0.3 - 4.0 * x[0] - 0.3 * sign(x[0]), 5.0 * (0.3 - x[1]));
        }),
    ];
    let mut source = Noise::new(7, "starts", 0).source("x");
    for (name, rates) in systems {
        for k in 0..3000 {
            // All the way, and next to where rates jump.
            let size = [0.5, 0.02, 3e-4][k % 3];
            let begin = [0; 2].map(|_| size * (2.0 * source.uniform() - 1.0));
            let end = stepped(0.125, begin, rates);
            let most = 0.125 * 5.0;
            for (from, to) in begin.iter().zip(end) {
                assert!((to - from).abs() < most, "{name} {begin:?}: {end:?}");
            }
        }
    }
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// A sled comes to rest at 2 s, after 1 m, and stays until it is pushed harder than friction holds, at 20 s.
#[test]
fn friction_holds_at_rest() {
    let sled = |t: f64, x: &[f64], dx: &mut [f64]| {
        let push = 0.2 + f64::max(0.0, 0.1 * (t - 15.0));
        (dx[0], dx[1]) = (x[1], push - 0.7 * sign(x[1]));
    };
    for rule in [Integrator::Adaptive, Integrator::Stiff] {
        let x = carried(rule, &[[0.0, 1.0]], 20, sled);
        let off = [x[0] - 1.0, x[1]];
        assert!(off.iter().all(|off| off.abs() < 1e-4), "{rule:?}: {off:?}");
    }
    let x = carried(Integrator::Adaptive, &[[0.0, 1.0]], 24, sled);
    let off = [x[0] - 1.0 - 6.4 / 6.0, x[1] - 0.8];
    assert!(off.iter().all(|off| off.abs() < 1e-4), "{off:?}");
}

/// Points of a filter pass dry friction each at its own time: all end where the exact ways do, and by differences as small as those of a search the
/// slopes are exact.
#[test]
fn points_pass_friction_smoothly() {
    let sled = |_: f64, x: &[f64], dx: &mut [f64]| {
        (dx[0], dx[1]) = (x[1], 2.0 - 0.6 * sign(x[1]));
    };
    let exact = |v: f64| 1.4 * (1.0 + v / 2.6);
    let starts = [-0.9, -0.6, -0.31, -0.3, -0.1];
    for rule in [Integrator::Adaptive, Integrator::Stiff] {
        for shift in 0..100 {
            let points = |by: f64| starts.map(|v| [0.0, v + 0.003 * f64::from(shift) - by]);
            let [here, there] = [0.0, 1e-6].map(|by: f64| carried(rule, &points(by), 1, sled));
            let begin = points(0.0);
            for (i, [_, v]) in begin.iter().enumerate().filter(|(_, [_, v])| *v < 0.0) {
                let (here, there) = (here[2 * i + 1], there[2 * i + 1]);
                assert!((here - exact(*v)).abs() < 1e-6, "{rule:?} from {v}: {here}");
                let slope = (here - there) / 1e-6;
                assert!(
                    (slope - 1.4 / 2.6).abs() < 0.01,
                    "{rule:?} from {v}: slope {slope}"
                );
            }
        }
    }
}

/// A state that friction holds stays while another one changes its push by more than friction within a step, and steps are short enough for a damping
/// that is faster than the rows.
#[test]
fn what_is_held_stays_beside_faster_states() {
    for change in [1.1, 2.0, -6.0] {
        let [x, _] = stepped(0.125, [0.0, 0.2], |_, x, dx| {
            (dx[0], dx[1]) = (x[1] - 0.6 * sign(x[0]), change);
        });
        assert!(x.abs() < 1e-6, "{change}: {x}");
    }
    for decay in [10.0, 20.0, 30.0] {
        let end = carried(
            Integrator::Adaptive,
            &[[0.3, 0.2], [0.31, 0.2]],
            3,
            |_, x, dx| {
                (dx[0], dx[1]) = (x[1] - 0.6 * sign(x[0]), decay * (0.3 - x[1]));
            },
        );
        let off = [end[0], end[1] - 0.3, end[2], end[3] - 0.3];
        assert!(off.iter().all(|off| off.abs() < 1e-3), "{decay}: {off:?}");
    }
}

/// Two blocks that rub on each other, and one of them on the ground: they come together and are then carried on by one force.
#[test]
fn blocks_that_stick_move_together() {
    let blocks = |_: f64, x: &[f64], dx: &mut [f64]| {
        let between = sign(x[0] - x[1]);
        (dx[0], dx[1]) = (0.5 - between, between);
    };
    let together = carried(Integrator::Adaptive, &[[0.0, 2.0]], 12, blocks);
    // 1.5 and -1 m/s² until 0.8 s, at 1.2 m/s; 0.25 m/s² for both from there.
    let expected = 1.2 + 0.25 * 11.2;
    let off = [together[0] - expected, together[1] - expected];
    assert!(off.iter().all(|off| off.abs() < 1e-3), "{off:?}");
    // Each held by the ground, too.
    let held = |_: f64, x: &[f64], dx: &mut [f64]| {
        (dx[0], dx[1]) = (
            0.3 - 0.5 * sign(x[0]),
            0.2 * (0.3_f64).sin() - 0.4 * sign(x[1]),
        );
    };
    let still = carried(Integrator::Adaptive, &[[0.5, -0.3]], 12, held);
    assert!(still.iter().all(|v| v.abs() < 1e-6), "{still:?}");
}

/// A belt that turns round carries what sticks to it: one point and three are where it is, at the end of each row.
#[test]
fn what_a_moving_jump_holds_moves_with_it() {
    let belt = |t: f64| (0.15 * t).sin();
    for points in [&[[0.0]][..], &[[0.0], [0.02], [-0.02]]] {
        for rule in [Integrator::Adaptive, Integrator::Stiff] {
            for rows in [1, 2, 10, 20, 40] {
                let x = carried(rule, points, rows, |t, x, dx| {
                    dx[0] = -0.2 * sign(x[0] - belt(t)) - 0.005 * x[0];
                });
                for x in x {
                    let off = (x - belt(rows as f64)).abs();
                    assert!(off < 1e-8, "{rule:?}, {rows} of {points:?}: {off:e}");
                }
            }
        }
    }
}

/// Where a belt moves on faster than friction follows, what it held falls behind at once: half a step of the wrong side's rate is an error of 0.03.
#[test]
fn a_belt_outruns_what_it_held() {
    let rates = |t: f64, x: &[f64], dx: &mut [f64]| {
        dx[0] = -0.5 * sign(x[0] - 0.3 * (2.0 * (t + 2.84375)).sin());
    };
    let [end] = stepped(1.0 / 32.0, [-0.16832284725], rates);
    assert!((end + 0.15271).abs() < 1e-3, "{end}");
}

/// Blocks on a spring that meet a belt late in a step of 0.125 s: where they end has no leaps.
#[test]
fn a_jump_at_the_end_of_a_step_is_met() {
    let mut last = None;
    for k in 0..=700 {
        let begin = [-0.1, 0.35 * f64::from(k) / 700.0];
        let [_, end] = stepped(0.125, begin, |t, x, dx| {
            let belt = 0.3 * (1.5 * (t + 0.5)).sin();
            (dx[0], dx[1]) = (x[1], -4.0 * x[0] - 0.8 * sign(x[1] - belt) - 0.1 * x[1]);
        });
        let leap = last.map_or(0.0, |last: f64| (end - last).abs());
        assert!(leap < 1e-3, "{begin:?}: {leap}");
        last = Some(end);
    }
}

/// A block with friction in thick oil, pushed to and fro, has fast rates from its first row on; a relay has a threshold that moves away and comes back
/// within a row. Both end where short steps do.
#[test]
fn first_rows_have_steps_that_are_short_enough() {
    type Rates = fn(f64, &[f64], &mut [f64]);
    let systems: [(&str, [f64; 2], f64, Rates); 3] = [
        ("oil", [0.0, 0.1], 1e-3, |t, x, dx| {
            let push = 3.0 * (5.0 * t).sin() - 2.0 * sign(x[1]);
            (dx[0], dx[1]) = (x[1], push - 100.0 * x[1]);
        }),
        ("thick oil", [0.0, 0.1], 1e-3, |t, x, dx| {
            let push = 9.0 * (5.0 * t).sin() - 6.0 * sign(x[1]);
            (dx[0], dx[1]) = (x[1], push - 300.0 * x[1]);
        }),
        ("relay", [0.1, 0.0], 2e-3, |t, x, dx| {
            let is_below = x[0] < 0.5 * (3.0 * t).sin();
            (dx[0], dx[1]) = (f64::from(u8::from(is_below)) - x[0], 0.0);
        }),
    ];
    for (name, begin, most, rates) in systems {
        let others = [begin, begin.map(|x| 1.1 * x), begin.map(|x| 0.9 * x)];
        for points in [&others[..1], &others] {
            for rows in 1..=3 {
                let ends = carried(Integrator::Adaptive, points, rows, rates);
                for (end, begin) in ends.chunks_exact(2).zip(points) {
                    let (mut exact, short) = (*begin, 1.0 / 20_000.0);
                    for i in 0..20_000 * rows {
                        let mut dx = [0.0; 2];
                        rates(i as f64 * short, &exact, &mut dx);
                        (0..2).for_each(|i| exact[i] += short * dx[i]);
                    }
                    for (end, exact) in end.iter().zip(exact) {
                        let off = (end - exact).abs();
                        assert!(
                            off < most,
                            "{name}, row {rows} of {points:?}: {end} {exact}"
                        );
                    }
                }
            }
        }
    }
}

/// A tank whose pump empties it beyond its bottom, where an outflow has no number: the run ends there, and takes no 100 000 steps before it does.
#[test]
fn rates_without_numbers_end_a_run() {
    let calls = std::cell::Cell::new(0);
    let x = carried(
        Integrator::Adaptive,
        &[[0.2], [0.21], [0.19]],
        2,
        |_, x, dx| {
            calls.set(calls.get() + 1);
            dx[0] = -x[0].sqrt() - 0.1;
        },
    );
    assert!(x.iter().all(|x| x.is_nan()), "{x:?}");
    assert!(calls.get() < 20_000, "{calls:?}");
}
