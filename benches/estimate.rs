//! One record of each reference twin, outside the prior, in the default preset: gate, Gauss–Newton, and the whole
//! estimate with tuned heads. The estimator is trained on a small bank, outside the timing. `cargo bench --bench estimate`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::time::Duration;
use truetwin::estimator::bank::FeatureSimulator;
use truetwin::estimator::gate::GateTest;
use truetwin::estimator::{EstimateOptions, PresetName, PretrainOptions, Project, pretrain};
use truetwin::evaluate::paper::{Benchmark, MonteCarlo, Scenario, reference_studies};
use truetwin::progress::Progress;
use truetwin::twin::Noise;

fn estimates(c: &mut Criterion) {
    let silent = Progress::silent();
    for study in reference_studies().expect("the reference studies are sound") {
        let small = PretrainOptions {
            bank_size: Some(2000),
            epochs: Some(10),
            ..PretrainOptions::default()
        };
        let (estimator, _) = pretrain(&study, &small, &silent).expect("it trains");
        let plan = MonteCarlo {
            benchmark: Benchmark::of(&study),
            scenario: Scenario::First,
            runs: 1,
            seed: 1,
        };
        let (theta, record) = plan.record(&study, 0).expect("the paper has this point");
        let twin = study.twin();
        let project = Project::from(&study);
        let preset = project.recipe(PresetName::Default);
        let simulator = FeatureSimulator::new(twin.clone(), preset.features.as_ref())
            .expect("the features fit the twin");
        let mut group = c.benchmark_group(study.name());
        group
            .throughput(Throughput::Elements(1))
            .sample_size(10)
            .warm_up_time(Duration::from_millis(500))
            .measurement_time(Duration::from_secs(4));
        let gate = GateTest {
            simulator: &simulator,
            drive: record.drive(),
            settings: &preset.settings.gate,
            noise: Noise::new(1, "bench", 0),
            progress: &silent,
        };
        group.bench_function("gate", |b| b.iter(|| gate.at(&theta)));
        let options = EstimateOptions {
            always_refine: true,
            ..EstimateOptions::default()
        };
        let refined = || (estimator.estimate(&record, &options, &silent)).expect("it is estimated");
        group.bench_function("Gauss–Newton", |b| {
            b.iter_custom(|times| {
                let seconds = (0..times).filter_map(|_| refined().seconds.gauss_newton);
                Duration::from_secs_f64(seconds.sum())
            })
        });
        group.bench_function("estimate, refined and tuned", |b| b.iter(refined));
        group.finish();
    }
}

criterion_group!(benches, estimates);
criterion_main!(benches);
