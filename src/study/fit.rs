//! Fit of a study's twin to records.

use super::{Study, StudyError};
use crate::effect::Effect;
use crate::fit::{
    Fit, FitScore, FitSettings, FitStages, Passes, ProfilesOf, Subject, Warning, other_hold, run,
    score,
};
use crate::hypothesis::search::asked::with_asked_noise;
use crate::hypothesis::search::effects::searched;
use crate::likelihood::kalman::FilterError;
use crate::likelihood::{Beliefs, measured, with_better_start};
use crate::progress::Progress;
use crate::record::Record;
use crate::setting::SettingError;
use crate::twin::conformance::blamed_step;
use crate::twin::{Noise, NoiseLevel, Role, StartLevel, Stepping, Twin};
use std::time::Instant;

impl Study {
    /// Finds the most probable parameters of the twin, given measured records of one system: no training, no simulations of a prior.
    ///
    /// Noise levels are fitted with the parameters, and the first state is uncertain, unless the study says that they are known. Where the
    /// records ask for it, the noise of an output grows with its signal.
    /// θ has a weak normal prior in φ (log θ where bounds are positive) of the prior box's width, 0.6 at least; bounds hold.
    ///
    /// ```
    /// use truetwin::prelude::*;
    /// use truetwin::twins::CascadedTanks;
    ///
    /// // 300 samples, 0.5 s apart; each level of the pump is held for 30 samples.
    /// let pump: Vec<f64> = (0..300).map(|k| [0.6, 2.1, 1.2, 2.8][k / 30 % 4]).collect();
    /// let drive = Drive::from_slices(0.5, &[&pump])?;
    /// let level = CascadedTanks.simulate(&[0.6, 0.5, 0.55, 1.0], &drive, Noise::new(1, "measured", 0))?;
    /// let record = Record::new(drive, level)?;
    /// let fit = Study::of(CascadedTanks)?.fit(&[record])?;
    /// assert!(fit.convergence.converged);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`StudyError`]: records that do not fit the twin, a twin that no start fits.
    pub fn fit(&self, records: &[Record]) -> Result<Fit, StudyError> {
        self.fit_with(records, &FitSettings::default(), &Progress::silent())
    }

    /// As [`fit`](Self::fit), with settings, and progress that can cancel it. The same seed gives the same bits on any number of threads.
    ///
    /// # Errors
    ///
    /// As [`fit`](Self::fit); settings that cannot be used, cancellation.
    pub fn fit_with(
        &self,
        records: &[Record],
        settings: &FitSettings,
        progress: &Progress,
    ) -> Result<Fit, StudyError> {
        let fit = || self.fit_asking(true, records, settings, progress);
        let mut fit = self.twin.side_by_side(fit)?;
        let shown = |(r, record)| Some((r, self.mistaken_time(record, settings.seed)?));
        let mistaken = records.iter().enumerate().filter_map(shown);
        (fit.warnings)
            .extend(mistaken.map(|(r, shown)| Warning::time_unit(shown, r, records.len())));
        Ok(fit)
    }

    /// As [`fit_with`](Self::fit_with); without asking, noise levels stay as they depend on the states in the twin, and nothing is profiled.
    pub(crate) fn fit_asking(
        &self,
        asks: bool,
        records: &[Record],
        settings: &FitSettings,
        progress: &Progress,
    ) -> Result<Fit, StudyError> {
        SettingError::unless_level("level", settings.level, 0.9)?;
        for (index, record) in records.iter().enumerate() {
            self.check_one_of(Some(index), record)?;
        }
        Record::check_outputs(records, &self.twin.signals().outputs)?;
        let clock = Instant::now();
        let study = self.for_records(records)?;
        let stage = progress.stage("fit", 1);
        let passes = Passes::heard_by(progress);
        let (mut fit, elsewhere) =
            (study.fit_once(asks, records, settings, &passes)).map_err(|error| match error {
                StudyError::Filter(FilterError::Diverged { .. }) => study.no_fit(records),
                other => other,
            })?;
        if elsewhere && !fit.interrupted && !self.file.effect.is_empty() {
            let trusting = study.trusting_starts();
            let again =
                || (trusting.fit_once(asks, records, settings, &passes)).map(|(fit, _)| fit);
            let log_z = |fit: &Fit| Some(fit.evidence.as_ref()?.log_evidence);
            (fit, _) = with_better_start((fit, self.bends_readings()), log_z, again)?;
        }
        fit.seconds = clock.elapsed().as_secs_f64();
        if !fit.interrupted {
            stage.tick()?;
        }
        Ok(fit)
    }

    /// The fit with one rule for starts, and whether a start that was said is given up in it.
    fn fit_once(
        &self,
        asks: bool,
        records: &[Record],
        settings: &FitSettings,
        passes: &Passes,
    ) -> Result<(Fit, bool), StudyError> {
        let effects = self.added_effects()?;
        let noise = settings.noise();
        let fitted = |twin: &Twin| -> Result<_, FilterError> {
            let measured = measured(twin, records, &self.beliefs())?;
            let searched = searched(&measured, &effects, records.into(), noise, passes)?;
            Ok((measured, searched))
        };
        let (mut measured, mut searched) = fitted(&self.twin)?;
        let mut stages = FitStages::new(passes, settings.give_partial);
        let mut other = match searched.fits.first() {
            Some(best) if self.asks_hold() => {
                stages.of(None, || other_hold(&searched.problem, best))?
            }
            _ => None,
        };
        if let Some(twin) = other.and_then(|other| self.with_steps(other.stepping)) {
            match stages.of(None, || fitted(&twin).map(Some))? {
                Some(again) => (measured, searched) = again,
                None => other = None,
            }
        }
        if asks {
            let constant = searched.clone();
            searched = stages.of(constant, || with_asked_noise(&measured, searched, noise))?;
        }
        let which = match (asks, settings.profile) {
            (_, true) => ProfilesOf::All,
            (true, false) => ProfilesOf::Shaped,
            (false, false) => ProfilesOf::None,
        };
        let fitted = run(&measured, searched, (settings, which), &mut stages)?;
        let mut fit = fitted.ok_or_else(|| self.no_fit(records))?;
        fit.stepping = other.map(|other| other.stepping);
        (fit.warnings).extend(other.map(|other| Warning::hold(other.stepping, Some(other.gain))));
        let given_up = measured.elsewhere.is_some_and(|start| !start.is_held);
        Ok((fit, given_up))
    }

    /// Scores a fit of this study on a record that it has not seen: log density of its rows, one-step and free-run errors.
    ///
    /// # Errors
    ///
    /// [`StudyError`]: a record that does not fit the twin, a twin that cannot be filtered there.
    pub fn score(&self, fit: &Fit, record: &Record) -> Result<FitScore, StudyError> {
        self.check_channels(record)?;
        let study = self.for_records(std::slice::from_ref(record))?;
        let held = fit.stepping.and_then(|stepping| study.with_steps(stepping));
        let subject = Subject {
            twin: held.as_ref().unwrap_or(&study.twin),
            beliefs: &study.beliefs(),
        };
        score(&subject, fit, record)?.ok_or_else(|| self.no_fit(std::slice::from_ref(record)))
    }

    /// The error of records that no parameters fit, with what is wrong in the middle of the prior: the step, if a finer one mends it.
    pub(crate) fn no_fit(&self, records: &[Record]) -> StudyError {
        let centre = self.twin.parameters().centre();
        let fault = |record: &Record| {
            let drive = record.drive();
            let error = self.twin.simulate(&centre, drive, Noise::OFF).err()?;
            let blamed = blamed_step(&self.twin, &centre, drive);
            Some(blamed.map_or(error.to_string(), |blamed| format!("the step is {blamed}")))
        };
        let cause = records.iter().find_map(fault);
        let cause = cause.map_or(String::new(), |cause| {
            format!(" (at the centre of the prior: {cause})")
        });
        StudyError::NoFit { cause }
    }

    /// Returns whether the records say how inputs move between samples: the study's file does not, neither for all nor for one.
    pub(crate) fn asks_hold(&self) -> bool {
        self.file.record.hold.or(self.hold).is_none() && !self.declared.holds
    }

    /// The twin with other substeps and another rule for inputs; `None` for a black box.
    fn with_steps(&self, to: Stepping) -> Option<Twin> {
        self.twin.stepped(|_, stepping| *stepping = to)
    }

    /// Effects that the study's file adds to the twin.
    pub(crate) fn added_effects(&self) -> Result<Vec<Effect>, StudyError> {
        let effects = self
            .file
            .effect
            .iter()
            .map(|entry| self.catalogue.resolve(entry));
        Ok(effects.collect::<Result<_, _>>()?)
    }

    /// Returns whether effects of the study are fitted, which may bend what a start shows.
    pub(crate) fn bends_readings(&self) -> bool {
        let space = self.twin.parameters();
        space.iter().any(|p| p.role == Role::Magnitude)
    }

    /// The study's word on noise levels and starts, for likelihoods of measured records.
    pub(crate) fn beliefs(&self) -> Beliefs {
        let noise = &self.file.noise;
        let factors = (noise.levels.iter()).filter_map(|(name, level)| match level {
            NoiseLevel::Declared(level) => Some((name.clone(), level.factor)),
            NoiseLevel::Estimate => None,
        });
        let starts = (self.file.start.iter())
            .filter(|(_, level)| matches!(level, StartLevel::Declared { .. }));
        // The tables of a study stand over what its equations say.
        let mut own = self.declared.clone();
        own.known.retain(|name| !noise.levels.contains_key(name));
        own.known.extend(noise.known(self.base.outline().as_ref()));
        own.factors.extend(factors);
        own.estimated
            .retain(|name| !self.file.start.contains_key(name));
        let unknown =
            (self.file.start.iter()).filter(|(_, level)| matches!(level, StartLevel::Estimate));
        own.estimated.extend(unknown.map(|(name, _)| name.clone()));
        Beliefs {
            // A study without a plan has been given the one of its records.
            step: self.plan.as_ref().map_or(1.0, |plan| plan.step),
            known: own.known,
            factors: own.factors,
            estimated: own.estimated,
            trusts_code: self.trusts_starts,
            // Effects of a study are resolved when it is made.
            off: (self.added_effects().unwrap_or_default().iter())
                .flat_map(Effect::off)
                .collect(),
            wide: (starts.clone())
                .filter(|(_, level)| !matches!(level, StartLevel::Declared { std: 0.0, .. }))
                .map(|(name, _)| name.clone())
                .collect(),
            starts: starts.map(|(name, _)| name.clone()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::{DiagnoseSettings, diagnose, fixture};
    use crate::progress::Listener;
    use crate::study::StudyFile;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A study of 61 samples, and a record of it at θ that is made with adaptive steps.
    fn recorded(tables: &str, step: f64, theta: &[f64]) -> (Study, [Record; 1]) {
        let [adaptive, fixed] = ["adaptive", "runge-kutta-4"].map(|integrator| {
            let text = format!(
                "{tables}[record]\nstep = {step}\nsamples = 61\nintegrator = '{integrator}'\n"
            );
            let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
            Study::of_file(&file).unwrap()
        });
        let drive = adaptive.drive(Noise::new(1, "drive", 0)).unwrap();
        let noise = Noise::new(1, "measured", 0);
        let outputs = adaptive.twin().simulate(theta, &drive, noise);
        (fixed, [Record::new(drive, outputs.unwrap()).unwrap()])
    }

    /// Says stop once it has been asked so many times.
    struct Patience {
        asked: AtomicUsize,
        most: usize,
    }

    impl Listener for Patience {
        fn advanced(&self, _: &str, _: u64, _: u64) {}
        fn cancelled(&self) -> bool {
            self.asked.fetch_add(1, Ordering::Relaxed) >= self.most
        }
    }

    /// Behind the search, a fit that is stopped gives its answer where that is wanted; nothing else does.
    #[test]
    fn a_fit_that_is_stopped_behind_its_search_gives_its_answer() {
        let study = fixture::tanks(120);
        let twin = study.twin();
        let records = [fixture::record(
            &study,
            twin,
            &twin.parameters().centre(),
            1,
        )];
        let fitted = |most: usize, give_partial: bool| {
            let patience = Arc::new(Patience {
                asked: AtomicUsize::new(0),
                most,
            });
            let settings = FitSettings {
                give_partial,
                draws: 200,
                ..FitSettings::default()
            };
            let fit = study.fit_with(&records, &settings, &Progress::new(patience.clone()));
            (fit, patience.asked.load(Ordering::Relaxed))
        };
        let (whole, all) = fitted(usize::MAX, true);
        let whole = whole.unwrap();
        assert!(!whole.interrupted && whole.posterior.is_some());
        let is_stopped =
            |fit: Result<Fit, StudyError>| matches!(fit, Err(StudyError::Cancelled(_)));
        assert!(is_stopped(fitted(3, true).0));
        assert!(is_stopped(fitted(all - 3, false).0));
        let part = fitted(all - 3, true).0.unwrap();
        assert!(part.interrupted && part.posterior.is_none());
        assert!(part.warnings.iter().any(|w| w.code == "interrupted"));
        for (part, whole) in part.parameters.iter().zip(&whole.parameters) {
            assert!((part.value - whole.value).abs() < 0.5 * whole.std_error);
        }
    }

    /// The step is told as the reason, whether a fit goes wrong or ends; what diverges by it alone is not told as the twin's fault.
    #[test]
    fn a_step_that_the_twin_cannot_take_is_the_reason() {
        let brusselator = "[twin]\nname = 'brusselator'\n\
            [parameters]\nA = { prior = [0.5, 6.0] }\nB = { prior = [0.5, 6.0] }\n\
            [states]\nX = { rate = 'A + X^2*Y - (B + 1)*X', start = 1.0 }\n\
            Y = { rate = 'B*X - X^2*Y', start = 1.0 }\n\
            [outputs]\ny1 = { value = 'X' }\ny2 = { value = 'Y' }\n";
        let reaction = "[twin]\nname = 'reaction'\n[parameters]\nk = { prior = [1e4, 1e5] }\n\
            [states]\na = { rate = '-k*a*b', start = 0.08 }\nb = { rate = '-k*a*b', start = 0.2 }\n\
            [outputs]\ny = { value = 'a', noise = 1e-3 }\n";
        let remedy = "the integrator adaptive";
        for (tables, step, theta) in [
            (brusselator, 0.5, &[1.0, 3.0][..]),
            (reaction, 0.01, &[3e4][..]),
        ] {
            let (fixed, records) = recorded(tables, step, theta);
            match fixed.fit(&records) {
                Ok(fit) => {
                    let mut told = fit.warnings.iter();
                    assert!(told.any(|w| w.what.contains(remedy)), "{:?}", fit.warnings);
                    let mut told = fit.warnings.iter();
                    assert!(told.all(|w| w.code != "free-run-diverges"));
                }
                Err(error) => assert!(error.to_string().contains(remedy), "{error}"),
            }
            let settings = DiagnoseSettings {
                quick: true,
                ..DiagnoseSettings::default()
            };
            let silent = Progress::silent();
            if let Err(error) = diagnose(&fixed, &records, None, &settings, &silent) {
                assert!(error.to_string().contains(remedy), "{error}");
            }
        }
    }
}
