//! Tests that need something from outside of the repository: measured records of real rigs, a browser. A test that cannot run is
//! reported as ignored, as are those that take minutes: `cargo test --release --test outside -- --ignored`.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "measured figures show with --nocapture"
)]

mod agreement;
#[path = "../browser/mod.rs"]
mod browser;
mod fits;
mod golden;
mod records;
#[path = "../../examples/rigs.rs"]
#[allow(dead_code, unreachable_pub)]
mod rigs;

use libtest_mimic::{Arguments, Trial};

/// Tests by name, ignored where what they need is not at hand.
macro_rules! trials {
    ($at_hand:expr; $($module:ident::$test:ident),+ $(,)?) => {
        vec![$(
            Trial::test(concat!(stringify!($module), "::", stringify!($test)), || {
                $module::$test();
                Ok(())
            })
            .with_ignored_flag(!$at_hand)
        ),+]
    };
}

fn main() {
    let arguments = Arguments::from_args();
    let (is_browser, are_records) = (browser::is_at_hand(), records::are_at_hand());
    let pages = trials![is_browser;
        browser::every_page_is_whole_at_every_width_and_in_print,
        browser::the_first_screen_answers_in_sixty_words,
        browser::a_broken_page_is_complained_of,
    ];
    // Each rig once, by fits.
    let records = trials![are_records;
        fits::the_overflow_of_real_tanks_is_found,
        fits::the_carriage_shows_its_friction,
        fits::the_heater_shows_its_lag,
    ];
    let long = trials![false;
        agreement::fits_and_diagnoses_of_rigs_weigh_effects_alike,
        golden::golden_answers_of_rigs_stay,
        fits::the_overflow_of_real_tanks_is_found_beside_others,
        fits::the_carriage_shows_its_friction_among_others,
        fits::the_heater_shows_its_lag_and_nothing_else,
        records::the_cascaded_tanks_are_followed_on_a_record_never_seen,
        records::the_cascaded_tanks_lack_their_overflow,
        records::what_the_cascaded_tanks_lack_is_explored,
        records::the_positioning_rig_lacks_dry_friction_and_an_offset,
        records::the_heater_lacks_a_lag,
    ];
    let all = (pages.into_iter()).chain(records).chain(long).collect();
    libtest_mimic::run(&arguments, all).exit();
}
