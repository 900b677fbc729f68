//! Each kind of features of one record: 400 rows of tanks, 300 of van der Pol. `cargo bench --bench features`.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use truetwin::evaluate::paper::reference_studies;
use truetwin::feature::{Ar, Armax, Arx, Deviation, FeatureRecipe, Score};
use truetwin::twin::Noise;

fn features(c: &mut Criterion) {
    let arx = |lags| Arx {
        outputs: lags,
        inputs: lags,
    };
    let armax = |lags, inputs| Armax {
        outputs: lags,
        inputs,
        noise: lags,
    };
    let autonomous: Vec<Box<dyn FeatureRecipe>> = vec![
        Box::new(Ar { order: 5 }),
        Box::new(armax(2, 0)),
        Box::new(Deviation { blocks: 64 }),
        Box::new(Score::default()),
    ];
    let driven: Vec<Box<dyn FeatureRecipe>> = vec![
        Box::new(arx(8)),
        Box::new(arx(64)),
        Box::new(armax(4, 4)),
        Box::new(Deviation { blocks: 64 }),
        Box::new(Score::default()),
    ];
    let studies = reference_studies().expect("the reference studies are sound");
    for (study, recipes) in studies.iter().zip([autonomous, driven]) {
        let twin = study.twin().clone();
        let noise = Noise::new(1, "bench", 0);
        let drives = study.drives().expect("the plan fits the twin");
        let drive = drives.draw(noise).expect("levels are finite");
        let centre = twin.parameters().centre();
        let outputs = twin.simulate(&centre, &drive, noise).expect("it is stable");
        let mut group = c.benchmark_group(study.name());
        group
            .throughput(Throughput::Elements(1))
            .sample_size(20)
            .warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_secs(2));
        for recipe in recipes {
            let map = recipe.bind(&twin).expect("fits the twin");
            group.bench_function(format!("{recipe:?}"), |b| {
                b.iter(|| map.extract(&drive, black_box(&outputs)))
            });
        }
        group.finish();
    }
}

criterion_group!(benches, features);
criterion_main!(benches);
