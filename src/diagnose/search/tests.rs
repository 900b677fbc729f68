//! The search beside a table of log Z.

use super::evidence::Question;
use super::explanations::Class;
use super::*;
use crate::diagnose::step::OtherStep;
use crate::effect::Catalogue;
use crate::hypothesis::search::Breadth;
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::term::{Nature, Part, Term, fixture};
use crate::progress::Listener;
use crate::twin::{Hold, Integrator, Stepping};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Purpose and names of a question.
type Asked = (Purpose, Vec<String>);

/// Evidence by a table: names begin with e (effect), f (function) or n (noise); a set that is not in the table is a nat worse than that
/// without its last term.
#[derive(Clone, Default)]
struct Table {
    twin: f64,
    names: Vec<&'static str>,
    /// log Z over the twin's of sets, written "e1 e2".
    nats: BTreeMap<&'static str, f64>,
    rows: (usize, usize),
    /// The table with another kind of noise, with a finer step, or with the twin's own instead of a finer one.
    changed: Option<Box<Table>>,
    /// The finer step that is asked for.
    step: Option<OtherStep>,
    /// `true` where the search begins with a finer step.
    is_finer: bool,
    asked: Arc<Mutex<Vec<Asked>>>,
}

fn term(name: &str) -> Arc<Term> {
    let nature = match &name[..1] {
        "e" => Nature::Listed,
        "f" => Nature::Function,
        _ => Nature::Noise,
    };
    let effect = Catalogue::default()
        .effect("constant-forcing", "h1")
        .unwrap();
    let held = BTreeMap::new();
    Arc::new(Term {
        id: "law".into(),
        part: Part::Effect { effect, held },
        ..fixture::wave(nature, name, 0.0)
    })
}

fn names(set: &TermSet) -> Vec<String> {
    let places = set.iter().map(|key| key.split_once('@').unwrap().1);
    places.map(str::to_owned).collect()
}

impl Table {
    fn new(nats: &[(&'static str, f64)]) -> Self {
        let mut names: Vec<&str> = nats.iter().flat_map(|(set, _)| set.split(' ')).collect();
        names.sort_unstable();
        names.dedup();
        Self {
            names,
            nats: nats.iter().copied().collect(),
            rows: (100, 100),
            ..Self::default()
        }
    }

    fn log_z(&self, terms: &[Arc<Term>]) -> f64 {
        let Some((_, before)) = terms.split_last() else {
            return self.twin;
        };
        let name = names(&TermSet::of(terms)).join(" ");
        match self.nats.get(name.as_str()) {
            Some(nats) => self.twin + nats,
            None => self.log_z(before) - 1.0,
        }
    }

    /// Sets beside which a question was asked, in order.
    fn asked(&self, purpose: Purpose) -> Vec<String> {
        let asked = self.asked.lock().unwrap();
        let such = asked.iter().filter(|(own, _)| *own == purpose);
        such.map(|(_, set)| set.join(" ")).collect()
    }

    fn search(&self, watch: Watch<'_>) -> Result<Search<Self>, StudyError> {
        search(self.clone(), BUDGET, watch)
    }

    fn found(&self) -> Search<Self> {
        let settings = DiagnoseSettings::default();
        let progress = Progress::silent();
        let watch = Watch {
            settings: &settings,
            progress: &progress,
        };
        self.search(watch).unwrap()
    }
}

impl Evidence for Table {
    fn twin(&self) -> Explanation {
        Explanation {
            terms: vec![],
            log_z: self.twin,
            model: None,
        }
    }

    fn answer(
        &self,
        question: &Question,
        known: &Explanations,
    ) -> Result<Option<Vec<Explanation>>, StudyError> {
        let mut asked = self.asked.lock().unwrap();
        asked.push((question.purpose, names(&question.beside)));
        let class = match question.class() {
            Class::Listed => "e",
            Class::Unknown => "f",
            Class::Noise => "n",
        };
        let beside = &known.get(&question.beside).unwrap().terms;
        let new = self.names.iter().filter(|name| name.starts_with(class));
        let all = new.map(|name| term(name)).filter(|new| {
            let is_asked = |only: &Vec<String>| only.contains(&new.key());
            question.only.as_ref().is_none_or(is_asked)
                && !beside.iter().any(|old| old.key() == new.key())
        });
        let sets = all.map(|new| [&beside[..], &[new]].concat());
        let explained = sets.map(|terms| Explanation {
            log_z: self.log_z(&terms),
            terms,
            model: None,
        });
        Ok(Some(explained.collect()))
    }

    fn fitted_from(&self, _: &[&Explanation]) -> Result<Option<Self>, StudyError> {
        Ok(None)
    }

    fn changed(&self, change: &Change, _: &Explanations) -> Result<Option<Self>, StudyError> {
        let (seen, all) = self.rows;
        Ok(match change {
            Change::Noise(_) | Change::Step { .. } | Change::OwnStep => {
                self.changed.as_deref().cloned()
            }
            Change::AllRows => Some(Self {
                rows: (all, all),
                ..self.clone()
            }),
            Change::MoreRows => Some(Self {
                rows: (all.min(4 * seen), all),
                ..self.clone()
            }),
        })
    }

    fn carried(&self, other: &Explanation) -> Result<Option<Explanation>, StudyError> {
        Ok(Some(Explanation {
            log_z: self.log_z(&other.terms),
            ..other.clone()
        }))
    }

    fn finer_step(
        &self,
        _: &Explanation,
        _: &Explanations,
    ) -> Result<Option<(OtherStep, f64)>, StudyError> {
        Ok(self.step.map(|step| (step, 5.0)))
    }

    fn breadth(&self) -> Breadth {
        Breadth {
            listed: 6,
            annealed: 6,
            functions: 6,
            least: 0.0,
            deep: false,
            afresh: false,
            pairs: true,
        }
    }

    fn rows(&self) -> (usize, usize) {
        self.rows
    }

    fn has_own_step(&self) -> bool {
        !self.is_finer
    }

    fn has_own_noise(&self) -> bool {
        true
    }
}

const FINER: OtherStep = OtherStep {
    integrator: Integrator::RungeKutta4,
    stepping: Stepping {
        substeps: 4,
        hold: Hold::Zero,
        tolerance: 1e-7,
    },
};

#[test]
fn nothing_more_is_asked_where_nothing_is_missing() {
    let table = Table::new(&[("e1", -1.0), ("e2", -2.0), ("f1", -1.0), ("n1", -1.0)]);
    let found = table.found();
    assert!(!found.is_gap());
    let asked: Vec<Purpose> = (table.asked.lock().unwrap().iter())
        .map(|(p, _)| *p)
        .collect();
    assert_eq!(
        asked,
        [Purpose::Functions, Purpose::Effects, Purpose::Noise]
    );
}

/// Second effects are asked beside the best effects first, and beside none that explains less than a third of the best.
#[test]
fn pairs_are_asked_where_they_pay_best_first() {
    let nats = [
        ("e1", 40.0),
        ("e2", 60.0),
        ("e3", 15.0),
        ("f1", 90.0),
        ("e1 e2", 120.0),
    ];
    let table = Table::new(&nats);
    let found = table.found();
    assert_eq!(table.asked(Purpose::Pairs), ["e2", "e1"]);
    let pair = found.known.winning_pair().unwrap();
    assert_eq!(names(&pair.set()), ["e1", "e2"]);
    // What the pair leaves is asked at the end.
    assert_eq!(found.known.suffices(pair), Some(true));
}

#[test]
fn an_effect_that_leaves_nothing_ends_the_search_for_remains() {
    let table = Table::new(&[("e1", 60.0), ("e2", 58.0), ("f1", 30.0)]);
    let found = table.found();
    assert_eq!(table.asked(Purpose::Remains), ["e1"]);
    assert_eq!(table.asked(Purpose::Pairs), ["e1"]);
    assert_eq!(found.known.suffices(found.known.listed()[0]), Some(true));
}

/// A change is kept if all hypotheses together are likelier with it, and else dropped; the search goes on without it.
#[test]
fn a_change_that_makes_it_worse_is_dropped() {
    let nats = [("e1", 60.0), ("f1", 30.0)];
    let with = |twin: f64| {
        let finer = Table {
            twin,
            ..Table::new(&nats)
        };
        let table = Table {
            step: Some(FINER),
            changed: Some(Box::new(finer)),
            ..Table::new(&nats)
        };
        table.found()
    };
    let better = with(5.0);
    assert_eq!(better.known.twin().log_z, 5.0);
    let worse = with(1.0);
    assert_eq!(worse.known.twin().log_z, 0.0);
    assert_eq!(worse.refused.len(), 1);
    assert_eq!(worse.known.suffices(worse.known.listed()[0]), Some(true));
}

/// A twin that was given a finer step at once is searched with its own step as well where something is missing, and keeps that unless the
/// finer one is clearly likelier.
#[test]
fn a_gap_that_passed_for_a_step_is_searched_with_the_own_step() {
    let with = |nats: f64, own: f64| {
        let own = Table {
            twin: own,
            ..Table::new(&[("e1", 60.0), ("f1", 30.0)])
        };
        let table = Table {
            is_finer: true,
            changed: Some(Box::new(own)),
            ..Table::new(&[("e1", nats), ("f1", 0.5 * nats)])
        };
        table.found()
    };
    assert!(!with(40.0, 1.0).evidence.is_finer);
    assert!(!with(60.0, -1.0).evidence.is_finer);
    let (lower, complete) = (with(60.0, -3.0), with(-1.0, 0.0));
    assert!(lower.evidence.is_finer && complete.evidence.is_finer);
    assert_eq!((lower.refused.len(), complete.refused.len()), (1, 0));
}

#[test]
fn likelier_noise_takes_the_place_of_a_gap_that_is_none() {
    let noisy = Table {
        twin: 20.0,
        ..Table::new(&[("e1", -1.0), ("f1", -1.0)])
    };
    let table = Table {
        changed: Some(Box::new(noisy)),
        ..Table::new(&[("e1", 10.0), ("f1", 8.0), ("n1", 20.0), ("n2", 0.0)])
    };
    let found = table.found();
    assert_eq!(found.known.twin().log_z, 20.0);
    assert!(!found.is_gap());
}

/// A clear gap in the first rows is carried on to all of them; otherwise more rows are searched.
#[test]
fn long_records_are_searched_in_part() {
    let of = |gain: f64| {
        let table = Table {
            rows: (100, 1600),
            ..Table::new(&[("e1", gain), ("e2", 1.0), ("f1", 2.0)])
        };
        let found = table.found();
        (found.evidence.rows, table.asked(Purpose::Functions).len())
    };
    assert_eq!(of(60.0), ((1600, 1600), 1));
    assert_eq!(of(0.0), ((1600, 1600), 3));
}

/// Stops the work once effects were tried one at a time.
#[derive(Default)]
struct Impatient(AtomicBool);

impl Listener for Impatient {
    fn advanced(&self, stage: &str, done: u64, _: u64) {
        let is_enough = stage == "explain" && done >= 3;
        self.0.fetch_or(is_enough, Ordering::Relaxed);
    }
    fn cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

#[test]
fn a_cancelled_search_keeps_what_is_known_and_is_marked() {
    let table = Table::new(&[("e1", 60.0), ("e2", 30.0), ("f1", 90.0)]);
    let found = |give_partial| {
        let settings = DiagnoseSettings {
            give_partial,
            ..DiagnoseSettings::default()
        };
        let progress = Progress::new(Arc::new(Impatient::default()));
        let watch = Watch {
            settings: &settings,
            progress: &progress,
        };
        table.search(watch)
    };
    let partial = found(true).unwrap();
    assert!(partial.is_partial && partial.is_gap());
    assert_eq!(partial.known.top(), 60.0);
    assert!(table.asked(Purpose::Pairs).is_empty());
    assert!(matches!(found(false), Err(StudyError::Cancelled(_))));
}

/// All pairs of n effects together are as probable as something else beside one of n, of the listed kind.
#[test]
fn a_second_effect_has_the_prior_of_something_else() {
    let n = 21;
    let mut known = Explanations::new(Table::default().twin());
    for i in 0..n {
        known.add(Explanation {
            terms: vec![term(&format!("e{i}"))],
            log_z: 0.0,
            model: None,
        });
    }
    let pairs = 0.5 * (n * (n - 1)) as f64;
    let share = pairs * (-known.price().of(2)).exp() / n as f64;
    assert!((share - THRESHOLDS.second * THRESHOLDS.listed).abs() < 1e-12);
    assert_eq!(known.price().of(1), 0.0);
}

/// A second effect has to add its prior, and a little of what the first one explains; what may imitate the step's error is asked about it,
/// the nearest rivals, too.
#[test]
fn a_second_effect_adds_a_share() {
    let candidates = |pair: f64| {
        let mut known = Explanations::new(Table::default().twin());
        for (names, log_z) in [("e1", 200.0), ("e2", 197.0), ("e3", 190.0), ("e1 e2", pair)] {
            known.add(Explanation {
                terms: names.split(' ').map(term).collect(),
                log_z,
                model: None,
            });
        }
        let all = known.candidates();
        all.iter().map(|e| e.log_z).collect::<Vec<f64>>()
    };
    assert_eq!(candidates(206.0), [200.0, 197.0]);
    assert_eq!(candidates(207.0), [207.0, 200.0, 197.0]);
}
