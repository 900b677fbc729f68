use super::explain::decide::decide;
use super::explain::explore::{Terms, explore};
use super::explain::search::{Breadth, Found};
use super::hypotheses::frequencies::frequencies;
use super::hypotheses::listed::Library;
use super::hypotheses::scales::Scales;
use super::hypotheses::{listed, unknown};
use super::model::Model;
use crate::fit::axis::Axis;
use crate::fit::problem::Problem;
use crate::fit::starts::{polish, search};
use crate::likelihood::measured;
use crate::twin::Role;
use std::sync::Arc;

fn show(name: &str, all: &[Found<'_>], n: usize) {
    print!("{name}: ");
    for f in all.iter().take(n) {
        print!("{} {:.1}{}  ", f.keys().join("+"), f.gain, if f.model.is_some() { "" } else { "~" });
    }
    println!();
}

fn run(study: &Study, records: &[Record], without: &[&str], breadth: Breadth) {
    let clock = std::time::Instant::now();
    let m = measured(study.twin(), records, &study.beliefs()).unwrap();
    let space = m.twin.parameters();
    let own = space.len() - m.levels.len();
    let mut axes: Vec<Axis> = (space.iter().take(own).map(Axis::of)).chain(m.levels.iter().map(Axis::of_level)).collect();
    for (axis, p) in axes.iter_mut().zip(space.iter()) { if p.role == Role::Start { axis.held = true; } }
    let problem = Problem::new(m.twin.clone(), axes, records);
    let fits = polish(&problem, search(&problem, &[], Noise::new(1, "diagnose", 0), 80).unwrap(), 80).unwrap();
    let base = Model::bare(&m.twin, problem, fits[0].clone()).unwrap();
    println!("base {:?} ll {:.2} logZ {:.2} in {:.2} s", base.theta(), base.fitted.log_likelihood, base.log_evidence, clock.elapsed().as_secs_f64());
    let scales = Scales::new(&m.twin, &base.theta(), records, base.states().unwrap(), base.problem.outline());
    let f = frequencies(&base).unwrap();
    let theta = base.theta();
    let library = Library { twin: &m.twin, theta: &theta, scales: &scales, frequencies: &f };
    let noisy: Vec<String> = m.levels.iter().filter_map(|l| {
        let name = l.parameter.target().to_owned();
        match l.is_process { true => Some(name), false => {
            let outputs = &scales.outline.outputs;
            let j = outputs.iter().position(|o| o.name == name)?;
            Some(if outputs.len() == 1 { "sensor".into() } else { format!("sensor{}", j + 1) })
        } }
    }).collect();
    let without: Vec<crate::effect::EffectPattern> = without.iter().map(|w| (*w).into()).collect();
    let all: Vec<Arc<_>> = listed(study, &without, &library, &noisy).unwrap().into_iter().map(Arc::new).collect();
    println!("rates {:?} defined {:?} listed {} unknown {} ({:.2} s)", scales.rates, scales.defined, all.len(), unknown(&library, &[]).len(), clock.elapsed().as_secs_f64());
    let wide = |seen: &[Scales<'_>]| unknown(&library, seen).into_iter().map(Arc::new).collect::<Vec<_>>();
    let terms = Terms { listed: &all, unknown: &wide };
    let findings = explore(&base, &terms, breadth).unwrap();
    show("  E", &findings.listed, 10);
    show("  U", &findings.unknown, 10);
    show("  P", &findings.several, 6);
    for (keys, left) in &findings.beside {
        print!("  on {} left {:?} ", keys.join("+"), findings.left(keys));
        show("", left, 4);
    }
    let chances = findings.chances();
    println!("  odds {:.2} nothing {:.3} unknown {:.3} sets {:?} places {:?}", chances.log_odds, chances.nothing, chances.unknown, chances.sets.iter().take(3).collect::<Vec<_>>(), chances.places);
    println!("  {:?}  [{:.2} s]", decide(&findings, 3), clock.elapsed().as_secs_f64());
    for f in findings.listed.iter().take(2).chain(findings.several.iter().take(1)) {
        if let Some(m) = &f.model { println!("   {} θ {:?}", f.keys().join("+"), m.theta()); }
    }
    let _ = Role::Noise;
}

const SIM: Breadth = Breadth { listed: 6, annealed: usize::MAX, functions: 3, least: 2.5, deep: false };

#[test]
#[ignore]
fn tanks() {
    use crate::effect::Catalogue;
    let study = crate::evaluate::paper::reference_studies().unwrap().into_iter().find(|s| s.name() == "tanks").unwrap();
    let catalogue = Catalogue::default();
    let drives = study.drives().unwrap();
    for (name, effect) in [
        ("null", None),
        ("null", None),
        ("null", None),
        ("ceiling", Some(catalogue.effect("state-ceiling", "h1").unwrap().with_other("h2").hold("level", 3.0).hold("spill", 0.5))),
        ("drag", Some(catalogue.effect("quadratic-drag", "h2").unwrap().hold("coefficient", 0.03))),
        ("lag", Some(catalogue.effect("sensor-lag", "sensor").unwrap().hold("tau", 4.0))),
        ("bias", Some(catalogue.effect("sensor-bias", "sensor").unwrap().hold("offset", 0.3))),
        ("periodic", Some(catalogue.effect("periodic-disturbance", "h2").unwrap().hold("amplitude", 0.15).hold("frequency", 0.03).hold("phase", 0.3))),
    ] {
        for seed in 1..2 {
            let noise = Noise::new(seed, name, 0);
            let drive = drives.draw(noise).unwrap();
            let theta = [0.6, 0.55, 0.6, 1.0];
            let mut full = theta.to_vec();
            let twin = match &effect {
                Some(e) => {
                    full.extend(e.magnitudes().iter().map(|m| e.given().get(m.name).unwrap()));
                    crate::effect::augment(study.twin().clone(), vec![e.clone()]).unwrap()
                }
                None => study.twin().clone(),
            };
            let outputs = twin.simulate(&full, &drive, noise).unwrap();
            let record = Record::new(drive, outputs).unwrap();
            println!("== {name} {seed}");
            run(&study, &[record], &[], SIM);
        }
    }
}

use crate::prelude::*;

// M·q̈ = F − Fv·q̇: a carriage with viscous friction.
struct Carriage;

impl StateSpace for Carriage {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("M", "kg", 50.0, 200.0).within(10.0, 1000.0))
            .parameter(Parameter::new("Fv", "N·s/m", 50.0, 1000.0).within(1.0, 5000.0))
            .state("q", "m")
            .state("v", "m/s")
            .input("F", "N")
            .output("y", "m")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let [mass, friction] = [now.theta[0], now.theta[1]];
        dx[0] = x[1];
        dx[1] = (now.u[0] - friction * x[1]) / mass;
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn integrator(&self) -> crate::twin::Integrator {
        crate::twin::Integrator::RungeKutta4
    }
}

// Ṫ = (Ta + K·Q − T)/τ: a heater without any delay.
struct Heater;

impl StateSpace for Heater {
    fn outline(&self) -> Outline {
        Outline::new()
            .parameter(Parameter::new("Ta", "°C", 15.0, 30.0).within(0.0, 50.0))
            .parameter(Parameter::new("K", "°C/%", 0.2, 2.0).within(0.01, 10.0))
            .parameter(Parameter::new("tau", "s", 50.0, 400.0).within(10.0, 2000.0))
            .state("T", "°C")
            .input("Q", "%")
            .output("y", "°C")
    }
    fn drift(&self, now: &Now, x: &[f64], dx: &mut [f64]) {
        let [ambient, gain, tau] = [now.theta[0], now.theta[1], now.theta[2]];
        dx[0] = (ambient + gain * now.u[0] - x[0]) / tau;
    }
    fn observe(&self, _: &Now, x: &[f64], y: &mut [f64]) {
        y[0] = x[0];
    }
    fn start(&self, _: &Now, x: &mut [f64]) {
        x[0] = 20.0;
    }
    fn integrator(&self) -> crate::twin::Integrator {
        crate::twin::Integrator::RungeKutta4
    }
}

fn rows(file: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(format!("/work/shared/data/{file}")).unwrap();
    text.lines().filter_map(|l| l.split(',').map(|c| c.trim().parse().ok()).collect::<Option<Vec<f64>>>()).collect()
}

fn of_rows(rows: &[Vec<f64>], t: usize, u: &[usize], y: &[usize]) -> Record {
    use crate::record::{Drive, Signal};
    let n = rows.len();
    let times: Vec<f64> = rows.iter().map(|r| r[t] - rows[0][t]).collect();
    let drive = Drive::with_times(&times, Signal::from_shape_fn((n, u.len()), |(k, j)| rows[k][u[j]])).unwrap();
    Record::new(drive, Signal::from_shape_fn((n, y.len()), |(k, j)| rows[k][y[j]])).unwrap()
}

const REAL: Breadth = Breadth { listed: 6, annealed: usize::MAX, functions: 6, least: 2.5, deep: false };

#[test]
#[ignore]
fn emps() {
    let study = Study::new("positioning", Carriage, RecordPlan::levels(0.02, 1242, -3.0, 3.0, 60)).unwrap();
    let rows: Vec<Vec<f64>> = rows("emps-estimation.csv").chunks_exact(2).map(|p| vec![p[0][0], 0.5 * (p[0][1] + p[1][1]), p[0][2]]).collect();
    run(&study, &[of_rows(&rows, 0, &[1], &[2])], &[], REAL);
}

#[test]
#[ignore]
fn heater() {
    for file in ["tclab-first.csv", "tclab-second.csv"] {
        let study = Study::new("heater", Heater, RecordPlan::levels(1.0, 600, 0.0, 100.0, 60)).unwrap();
        run(&study, &[of_rows(&rows(file), 0, &[1], &[2])], &[], REAL);
    }
}

#[test]
#[ignore]
fn real_tanks() {
    let study = crate::evaluate::paper::reference_studies().unwrap().into_iter().find(|s| s.name() == "tanks").unwrap();
    let file: crate::study::StudyFile = toml::from_str(&std::fs::read_to_string("examples/cascaded-tanks.toml").unwrap()).unwrap();
    let study = study.configure(&file).unwrap();
    let rows = rows("cascaded-tanks-estimation.csv");
    let r = of_rows(&rows, 0, &[1], &[2]);
    run(&study, &[r.clone()], &[], REAL);
    if std::env::var("BOTH").is_err() { return; }
    run(&study, &[r], &["state-ceiling", "power-law"], REAL);
}

#[test]
#[ignore]
fn coulomb() {
    use super::explain::{refit::*, scan::*};
    let study = Study::new("positioning", Carriage, RecordPlan::levels(0.02, 1242, -3.0, 3.0, 60)).unwrap();
    let rows: Vec<Vec<f64>> = rows("emps-estimation.csv").chunks_exact(2).map(|p| vec![p[0][0], 0.5 * (p[0][1] + p[1][1]), p[0][2]]).collect();
    let records = [of_rows(&rows, 0, &[1], &[2])];
    let m = measured(study.twin(), &records, &study.beliefs()).unwrap();
    let space = m.twin.parameters();
    let own = space.len() - m.levels.len();
    let axes: Vec<Axis> = (space.iter().take(own).map(Axis::of)).chain(m.levels.iter().map(Axis::of_level)).collect();
    for l in &m.levels { println!("{} median {:.3e} loud {:.3e}", l.parameter.name, l.median, l.loud); }
    let problem = Problem::new(m.twin.clone(), axes, &records);
    let fits = polish(&problem, search(&problem, &[], Noise::new(1, "diagnose", 0), 80).unwrap(), 80).unwrap();
    let base = Model::bare(&m.twin, problem, fits[0].clone()).unwrap();
    let scales = Scales::new(&m.twin, &base.theta(), &records, base.states().unwrap(), base.problem.outline());
    let theta = base.theta();
    let library = Library { twin: &m.twin, theta: &theta, scales: &scales, frequencies: &[] };
    let all: Vec<Arc<_>> = listed(&study, &[], &library, &[]).unwrap().into_iter().filter(|t| t.key() == std::env::var("KEY").unwrap_or("coulomb-friction@v".into())).map(Arc::new).collect();
    let loud = loudly(&base).unwrap().unwrap();
    println!("loud θ {:?}", loud.theta());
    for (name, model) in [("quiet", &base), ("loud", &loud)] {
        for p in scan(model, &all).unwrap() {
            for s in p.starts.iter().take(3) { println!("{name} start {:.1} {:?} answer {:?}", s.nats, s.m, s.answer.as_slice()); }
            let e = model.extend(&p.term).unwrap();
            let mut t = model.beside(&e, &p.starts[0].m);
            if name == "loud" {
                for share in [0.0, 0.25, 0.5, 0.75, 0.9, 1.0] {
                    let c = &e.problem.coordinates;
                    let mut phi = c.of(&t);
                    let (a, b) = (loud.problem.coordinates.of(&loud.fitted.theta), base.problem.coordinates.of(&base.fitted.theta));
                    for j in 2..5 { phi[j] = (1.0 - share) * a[j] + share * b[j]; }
                    let f = crate::fit::climb::climb(&e.problem, &c.theta(&phi), 10).unwrap().unwrap();
                    println!("share {share}: {:.1} {:?}", f.log_likelihood, f.theta);
                    t = f.theta;
                }
                let free = base.extend(&p.term).unwrap();
                for n in [10, 20, 40, 80, 160] {
                    let f = crate::fit::climb::climb(&free.problem.until(1e-6), &t, n).unwrap().unwrap();
                    println!("free {n}: {:.1} {:?} grad {:?}", f.log_likelihood, f.theta, f.gradient.as_slice());
                }
            }
            let free = base.extend(&p.term).unwrap();
            let all = search(&free.problem, &[], Noise::new(3, "x", 0), 80).unwrap();
            for f in &all { println!("search {:.1} {:?}", f.log_likelihood, f.theta); }
        }
    }
}
