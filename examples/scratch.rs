//! scratch
use truetwin::experiment::*;
use truetwin::progress::Progress;
use truetwin::study::*;
use truetwin::two_stage::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let preset = if a[2] == "paper" { PresetName::Paper } else { PresetName::Default };
    let study = reference_studies().unwrap().into_iter().find(|s| s.name() == a[1]).unwrap();
    let t = std::time::Instant::now();
    let path = std::path::PathBuf::from(format!("/tmp/{}-{}.est", a[1], a[2]));
    let est = if path.exists() { Estimator::load(&path, &reference_studies().unwrap()).unwrap() } else {
        let opt = PretrainOptions { preset, seed: 1, bank_size: None, epochs: None };
        let (est, h) = pretrain(&study, &opt, &Progress::silent()).unwrap();
        println!("pretrain {:?} {:?}", t.elapsed(), h.training.last());
        est.save(&path).unwrap();
        est };
    for sc in [Scenario::First, Scenario::Second, Scenario::InDistribution] {
        let s = score(&est, &MonteCarlo { scenario: sc, runs: a[3].parse().unwrap(), seed: 7 }, &Progress::silent()).unwrap();
        println!("{sc:?}");
        for m in s { println!("  {:8} mse {:.3e} median {:.3e} {:.1} ms", m.method.to_string(), m.mse, m.median, m.milliseconds); }
    }
}
