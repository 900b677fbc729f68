//! Long records: the search sees their first rows, and what stands out there is fitted to all of them.
//!
//! ```text
//! n = 1024 rows, 4 n, 16 n …        until a gap is clear there
//! log Z of all rows                 of the twin, and of what stands out, each fitted on from there
//!                                   of the rest: that of the n rows times N/n, at most that of the best
//! ```

use super::explain::findings::Findings;
use super::explain::found::{Found, sort};
use super::explain::pairs::{FIRST, SINGLES};
use super::rounds::{self, Explored};
use super::settings::DiagnoseSettings;
use crate::hypothesis::model::Model;
use crate::progress::{Progress, Stage};
use crate::record::Record;
use crate::study::{Study, StudyError};
use rayon::prelude::*;
use std::sync::Arc;

/// Rows of all records together from which they are long. On two cores, a gap in half as many takes a minute.
const LONG: usize = 4096;
/// Rows that the search begins with. With twice as many it takes twice as long; what half as many show, four times as many are asked for.
const FIRST_ROWS: usize = 1024;
/// Factor by which more rows are searched where a gap is not clear.
const MORE: usize = 4;
/// log of the odds from which a gap is clear: a rival that has a third of it stays in the race, and is 20 nats away.
const CLEAR: f64 = 30.0;
/// Functions that are fitted to all rows, alone and on top of an explanation.
const FUNCTIONS: usize = 2;

/// Fits the twin, searches for what explains the records beside it, and hands it all on.
pub(super) fn search<R>(
    study: &Study,
    records: &Arc<[Record]>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_>) -> Result<R, StudyError>,
) -> Result<R, StudyError> {
    match search_part(study, records, settings, progress, then)? {
        Some(found) => Ok(found),
        None => rounds::search(study, records, settings, progress, then),
    }
}

/// Searches the first rows of long records and hands on what is found there, fitted to all rows. `None` where records are short, where no
/// part shows a clear gap, and where a wave explains most: its frequency is known as sharply as the record is long.
fn search_part<R>(
    study: &Study,
    records: &Arc<[Record]>,
    settings: &DiagnoseSettings,
    progress: &Progress,
    then: &dyn Fn(Explored<'_>) -> Result<R, StudyError>,
) -> Result<Option<R>, StudyError> {
    let rows: usize = records.iter().map(Record::samples).sum();
    if rows < LONG || study.twin().outline().is_none() {
        return Ok(None);
    }
    let mut first = FIRST_ROWS;
    while MORE * first <= rows {
        let Some(part) = first_rows(records, first) else {
            return Ok(None);
        };
        let on_all = |own: Explored<'_>| -> Result<Option<R>, StudyError> {
            if own.posterior.log_odds < CLEAR || own.findings.leads_with_wave() {
                return Ok(None);
            }
            let stage = progress.stage("all rows", 1);
            let Some(base) = own.base.on(records.clone())? else {
                return Ok(None);
            };
            let carry = Carry {
                settings,
                origins: [own.base.model.log_evidence, base.model.log_evidence],
                ratio: rows as f64 / first as f64,
                model: &base.model,
            };
            let findings = carry.findings(&own.findings, &stage)?;
            stage.finish();
            then(Explored {
                study,
                base: &base,
                listed: own.listed,
                posterior: findings.posterior(),
                findings,
                not_tested: own.not_tested,
                searched: Some(first),
            })
            .map(Some)
        };
        match rounds::search(study, &part, settings, progress, &on_all) {
            Ok(Some(found)) => return Ok(Some(found)),
            // What does not move yet cannot be fitted.
            Ok(None) | Err(StudyError::NoStart) => {}
            Err(error) => return Err(error),
        }
        first *= MORE;
    }
    Ok(None)
}

/// The same share of each record, so many rows in all; `None` where an output has no value in them.
fn first_rows(records: &[Record], rows: usize) -> Option<Arc<[Record]>> {
    let all: usize = records.iter().map(Record::samples).sum();
    (records.iter())
        .map(|record| record.first_part((record.samples() * rows).div_ceil(all)))
        .collect()
}

/// Carries fits from a part of the records on to all of them.
struct Carry<'m> {
    settings: &'m DiagnoseSettings,
    /// log Z of the twin on the part, and on all rows.
    origins: [f64; 2],
    /// All rows over those of the part.
    ratio: f64,
    /// The twin on all rows.
    model: &'m Model,
}

impl Carry<'_> {
    fn findings(&self, old: &Findings, stage: &Stage) -> Result<Findings, StudyError> {
        let least = FIRST * old.top();
        // Few fits, some of which take many times as long as others: all at once.
        let of = |all, most, least| self.all(all, most, least);
        // What remains beside sets that are out of the race is of no weight.
        let beside = || -> Result<Vec<_>, StudyError> {
            (old.beside.par_iter())
                .filter(|(keys, _)| old.gain(keys).is_some_and(|gain| gain > least))
                .map(|(keys, on_top)| Ok((keys.clone(), of(on_top, FUNCTIONS, 0.0)?)))
                .collect()
        };
        let ((unknown, listed), (several, (beside, noise))) = rayon::join(
            || {
                rayon::join(
                    || of(&old.unknown, FUNCTIONS, 0.0),
                    || of(&old.listed, SINGLES, least),
                )
            },
            || {
                rayon::join(
                    || of(&old.several, SINGLES, least),
                    || rayon::join(beside, || of(&old.noise, 1, 0.0)),
                )
            },
        );
        let mut findings = Findings {
            listed: listed?,
            unknown: unknown?,
            several: several?,
            noise: noise?,
            noise_pairs: of(&old.noise_pairs, 1, 0.0)?,
            ..Findings::default()
        };
        let fitted = |(keys, _): &(Vec<String>, _)| findings.model(keys).is_some();
        findings.beside = beside?.into_iter().filter(fitted).collect();
        findings.is_partial = old.is_partial || self.settings.ends(stage.tick())?;
        Ok(findings)
    }

    /// Explanations on all rows, best first: so many of the best fitted, if they have more than these nats on the part.
    fn all(&self, old: &[Found], most: usize, least: f64) -> Result<Vec<Found>, StudyError> {
        let fitted: Vec<Option<Found>> = (old.par_iter().take(most))
            .map(|found| match found.gain > least {
                true => self.fitted(found),
                false => Ok(None),
            })
            .collect::<Result<_, _>>()?;
        let best = (fitted.iter().flatten())
            .map(|found| found.gain)
            .fold(f64::NEG_INFINITY, f64::max);
        let mut fitted = fitted.into_iter();
        let mut all: Vec<Found> = (old.iter())
            .map(|found| {
                fitted.next().flatten().unwrap_or_else(|| {
                    let mut other = found.promised();
                    if other.gain > 0.0 {
                        other.gain = (self.ratio * other.gain).min(best.max(0.0));
                    }
                    other
                })
            })
            .collect();
        sort(&mut all);
        Ok(all)
    }

    /// One explanation fitted to all rows; `None` where it was not fitted to the part.
    fn fitted(&self, old: &Found) -> Result<Option<Found>, StudyError> {
        let Some(own) = &old.model else {
            return Ok(None);
        };
        let [before, now] = self.origins;
        Ok(own.beside_twin(self.model)?.map(|model| Found {
            terms: old.terms.clone(),
            gain: old.gain + (model.log_evidence - now) - (own.log_evidence - before),
            model: Some(model),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::diagnose;
    use crate::diagnose::fixture::{biased_record, record, tanks};

    /// A gap of a long record is found in its first rows and fitted to all of them: the magnitude is known as well as all rows let it be.
    #[test]
    fn a_long_record_is_searched_in_part() {
        let study = tanks(LONG);
        let settings = DiagnoseSettings {
            quick: true,
            ..DiagnoseSettings::default()
        };
        let found = |record: Record| {
            diagnose(&study, &[record], None, &settings, &Progress::silent()).unwrap()
        };
        let biased = found(biased_record(&study, 2.0, 5));
        assert_eq!(biased.cause.accepted, ["sensor-bias@sensor"]);
        let bias = biased.cause.effects[0].magnitudes[0].1;
        assert!((bias - 2.0).abs() < 0.1, "{bias}");
        assert!(biased.warnings.iter().any(|w| w.code == "first-rows"));
        assert_eq!(biased.residuals[0].samples(), LONG);
    }

    /// Where the first rows show no clear gap, all rows are searched.
    #[test]
    fn no_gap_is_told_of_all_rows() {
        let study = tanks(LONG);
        let theta = study.twin().parameters().centre();
        let records = Arc::from([record(&study, study.twin(), &theta, 3)]);
        let settings = DiagnoseSettings {
            detection_only: true,
            ..DiagnoseSettings::default()
        };
        let seen = search(&study, &records, &settings, &Progress::silent(), &|found| {
            Ok((found.searched, found.posterior.log_odds))
        });
        let (searched, log_odds) = seen.unwrap();
        assert_eq!(searched, None);
        assert!(log_odds < 3.0, "{log_odds}");
    }
}
