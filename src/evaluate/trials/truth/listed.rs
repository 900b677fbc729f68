//! A listed effect that worlds can have.

use crate::evaluate::trials::draft::Draft;
use crate::evaluate::trials::law::Place;
use crate::evaluate::trials::places::Places;
use crate::study::Study;

/// An effect of the study's library, as a law of the world.
pub(super) struct Listed {
    pub key: String,
    pub id: String,
    pub place: Place,
    /// The other state of a law between two.
    pub other: Option<usize>,
}

impl Listed {
    /// Returns the effects that the study may name and that worlds can have.
    pub fn all(study: &Study, places: &Places) -> Vec<Self> {
        let state = |name: &str| places.states.iter().position(|s| s == name);
        (study.candidates().iter())
            .filter(|effect| Draft::knows(effect.id()))
            .filter_map(|effect| {
                Some(Self {
                    key: effect.key().to_string(),
                    id: effect.id().into(),
                    place: places.find(effect.id(), effect.target())?,
                    other: effect.other().and_then(state),
                })
            })
            .collect()
    }
}
