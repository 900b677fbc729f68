//! Kills, signals, full disks and manifests of another version, mixed at random: the same call ends the work, with the content of one that
//! was never disturbed. On a small file system of our own, in a name space of our own.

use crate::calls::run;
use crate::faults::in_name_space;
use crate::files::files;
use crate::studies::short;
use crate::timeless::timeless;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// A call that keeps its work, and what the disturbed one has in common with another.
struct Work {
    call: &'static str,
    /// Folder with the manifest, until the work is done.
    kept: &'static str,
    /// Seconds that the whole work takes, about.
    whole: f64,
    same: fn(&Path, &Path),
}

const ALL: [Work; 4] = [
    Work {
        call: "bank --twin van-der-pol --size 6000",
        kept: "disk/it",
        whole: 0.4,
        same: |a, b| assert!(files(a) == files(b)),
    },
    Work {
        call: "pretrain --twin van-der-pol --bank-size 2000 --epochs 10 --checkpoint 0",
        kept: "disk/it.part",
        whole: 1.0,
        same: |a, b| assert!(fs::read(a).unwrap() == fs::read(b).unwrap()),
    },
    Work {
        call: "withheld --study short.toml --trials 4 --kinds none,outside --detection-only",
        kept: "disk/it",
        whole: 3.0,
        same: |a, b| same_result(a, b, "scorecard.json"),
    },
    Work {
        call: "reproduce --twin van-der-pol --runs 8 --bank-size 200 --epochs 2",
        kept: "disk/it",
        whole: 2.0,
        same: |a, b| same_result(a, b, "reproduce.json"),
    },
];

fn same_result(a: &Path, b: &Path, name: &str) {
    let [a, b] = [a, b].map(|folder| folder.join(name));
    assert_eq!(timeless(&a), timeless(&b));
}

/// The commands of one disturbance. The call may be over before it comes; then it is done again, which changes nothing.
fn disturbance(work: &Work, random: &mut ChaCha8Rng) -> String {
    let call = format!("$TRUETWIN {} --out disk/it", work.call);
    let after = random.gen_range(0.02..work.whole);
    match random.gen_range(0..4) {
        0 => format!("timeout -s KILL {after:.3} {call} || true\n"),
        1 => {
            let signal = ["INT", "TERM"].choose(random).unwrap();
            // Done, stopped, or an estimator that is there already.
            format!(
                "timeout --preserve-status -s {signal} {after:.3} {call} && code=0 || code=$?\n\
                 case $code in 0|2|130) ;; *) exit 71;; esac\n"
            )
        }
        2 => {
            let room = random.gen_range(4..400);
            format!(
                "mount -o remount,size=$(( $(du -sk disk | cut -f1) + {room} ))k disk\n\
                 {call} && code=0 || code=$?\n\
                 case $code in 0|2) ;; *) exit 72;; esac\n\
                 mount -o remount,size=100m disk\n"
            )
        }
        _ => format!(
            "if test -e {kept}/manifest.json; then\n\
             cp {kept}/manifest.json manifest\n\
             sed -i -e 's/\"version\": *\"[^\"]*\"/\"version\": \"0.0.9\"/' -e '/\"sha256\":/d' {kept}/manifest.json\n\
             {call} 2> other && exit 73 || test $? = 2\n\
             grep -q -e version -e 'exists already' other || exit 74\n\
             cp manifest {kept}/manifest.json; rm manifest\n\
             fi\n",
            kept = work.kept
        ),
    }
}

/// Disturbs each work `rounds` times, `each` times until it is brought to its end and compared.
fn disturbed(seed: u64, rounds: usize, each: usize) {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    short(at);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for work in &ALL {
        let verb = work.call.split(' ').next().unwrap();
        let words = format!("{} --out {verb}-whole", work.call);
        assert!(run(at, &words).status.success(), "{verb}");
        for session in 0..rounds / each {
            let mut script = String::from("mkdir -p disk; mount -t tmpfs -o size=100m none disk\n");
            for _ in 0..each {
                script += &disturbance(work, &mut random);
            }
            let _ = write!(
                script,
                "test -f disk/it || $TRUETWIN {} --out disk/it\n\
                 test $(ls -A disk | wc -l) = 1 || exit 75\n\
                 cp -r disk/it {verb}-{session}\n",
                work.call
            );
            let Some(output) = in_name_space(at, &script) else {
                return;
            };
            assert!(output.status.success(), "{verb}: {output:?}\n{script}");
            let [one, whole] = [format!("{verb}-{session}"), format!("{verb}-whole")];
            (work.same)(&at.join(one), &at.join(whole));
        }
    }
}

#[test]
fn work_is_the_same_whatever_disturbs_it() {
    disturbed(1, 3, 3);
}

#[test]
#[ignore = "200 disturbances, some minutes"]
fn work_is_the_same_whatever_disturbs_it_200_times() {
    disturbed(2, 50, 5);
}
