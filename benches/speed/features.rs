//! Each kind of features of one record: 400 rows of tanks, 300 of van der Pol.

use crate::Clock;
use std::hint::black_box;
use truetwin::evaluate::paper::reference_studies;
use truetwin::feature::{Ar, Armax, Arx, Deviation, FeatureRecipe, Score};
use truetwin::twin::Noise;

pub fn run(clock: &Clock) {
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
        let drive = study.drive(noise).expect("the plan fits the twin");
        let centre = twin.parameters().centre();
        let outputs = twin.simulate(&centre, &drive, noise).expect("it is stable");
        for recipe in recipes {
            let map = recipe.bind(&twin).expect("fits the twin");
            clock.time(
                &format!("features: {}, {recipe:?}", study.name()),
                1,
                || map.extract(&drive, black_box(&outputs)),
            );
        }
    }
}
