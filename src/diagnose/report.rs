//! Everything that is reported of a search: the answer, where, and how far.

use super::answer::summary::{absorbed, effects, nuisance, onset, parameters, remains};
use super::answer::{Answer, Hypotheses};
use super::base::finished;
use super::candidates::not_tested;
use super::locate::discover::discover;
use super::locate::functions::{curve, missing_functions};
use super::locate::maps::maps;
use super::outcome::*;
use super::predictive::{Predictive, declared};
use super::prior::{absorbing, left_the_prior};
use super::quantify::calibrate::{calibrate, p_value};
use super::quantify::free_run::{Runner, free_runs, root};
use super::quantify::next_input::next_input;
use super::quantify::power::power;
use super::quantify::share::{Measures, shrinkage};
use super::search::{Search, Setup, Watch, searched};
use super::settings::DiagnoseSettings;
use super::step::OtherStep;
use super::thresholds::THRESHOLDS;
use crate::fit::Warning;
use crate::fit::posterior::{DrawsAsked, PosteriorSample, posterior};
use crate::hypothesis::search::explanation::Explanation;
use crate::hypothesis::search::model::Model;
use crate::hypothesis::set::TermSet;
use crate::hypothesis::term::Part;
use crate::likelihood::kalman::recoverable;
use crate::likelihood::start_elsewhere;
use crate::progress::Stage;
use crate::record::Record;
use crate::study::{Study, StudyError};
use crate::twin::Stepping;

/// A search and what its report is to hold.
pub(super) struct Report<'d> {
    pub study: &'d Study,
    pub found: &'d Search<Setup<'d>>,
    /// A record that the search did not see.
    pub validation: Option<&'d [Record]>,
    pub watch: Watch<'d>,
}

/// Extent of a gap: the next input, the smallest visible effects, the share closed.
#[derive(Default)]
struct Extent {
    next_input: Option<NextInput>,
    power: Vec<Visible>,
    shrinkage: Option<Shrinkage>,
}

impl Report<'_> {
    /// Decides, locates and measures.
    pub fn diagnosis(&self, detection: Detection) -> Result<Diagnosis, StudyError> {
        let (known, base) = (&self.found.known, &self.found.evidence.base);
        let (settings, records) = (self.watch.settings, &base.model.problem.records);
        let (answer, absorbed) = self.answer()?;
        let (answer, check) = self.checked(answer)?;
        let accepted = self.accepted(&answer).and_then(|e| e.model.as_ref());
        let accepted = accepted.map(finished).transpose()?;
        let accepted = accepted.as_ref();
        let last = accepted.unwrap_or(&base.model);
        let stage = self.watch.progress.stage("where and how far", 4);
        let (location, discovery) = match self.tells_more(&answer) {
            true => self.location(&answer, accepted)?,
            false => Default::default(),
        };
        settings.ends(stage.tick())?;
        let extent = match settings.detection_only {
            true => Extent::default(),
            false => self.extent(&answer, accepted, &stage)?,
        };
        let parameters = parameters(last, &base.theta, settings)?;
        let filtered = recoverable(last.problem.filtered(&last.fitted.theta))?;
        Ok(Diagnosis {
            twin: self.study.name().into(),
            verdict: answer.verdict,
            detection,
            check,
            warnings: self.warnings(records, &parameters, answer.verdict),
            residuals: (records.iter().zip(filtered.into_iter().flatten()))
                .filter_map(|(record, filtered)| {
                    Record::new(record.drive().clone(), filtered.standardised).ok()
                })
                .collect(),
            parameters,
            nuisance: nuisance(last, &base.noises)?,
            location: Location {
                onset: accepted.and_then(onset),
                ..location
            },
            cause: Cause {
                decision: answer.decision,
                effects: match self.tells_more(&answer) {
                    true => effects(known, &answer, accepted),
                    false => absorbed,
                },
                probabilities: answer.posterior.kinds,
                remains: remains(known, &answer),
                next_input: extent.next_input,
                class: answer.class,
                accepted: answer.accepted,
            },
            shrinkage: extent.shrinkage,
            discovery,
            power: extent.power,
            free_runs: self.free_runs(&records[..1], accepted)?,
            validation_runs: (self.validation)
                .map(|records| self.free_runs(records, accepted))
                .transpose()?,
            correlated_noise: base.noise_at(|part| matches!(part, Part::Disturbance { .. })),
            proportional_noise: base.noise_at(|part| matches!(part, Part::Share { .. })),
            outliers: base.noise_at(|part| matches!(part, Part::Effect { .. })),
            quick: settings.quick,
            interrupted: self.found.is_partial,
            integrator: self.finer().map(|step| step.integrator),
            substeps: self.finer().map(|step| step.stepping.substeps),
            hold: self.other_hold().map(|stepping| stepping.hold),
            candidates: known.listed().len() + known.unknown().len(),
            not_tested: not_tested(self.study, &self.found.evidence.listed),
            passes: base.model.problem.passes().so_far(),
            seconds: 0.0,
        })
    }

    /// The finer step that was used in place of the twin's own.
    fn finer(&self) -> Option<OtherStep> {
        let (integrator, own) = self.study.twin().integration()?;
        let is_own = |step: &OtherStep| {
            (step.integrator, step.stepping.substeps) == (integrator, own.substeps)
        };
        self.found.evidence.base.step.filter(|step| !is_own(step))
    }

    /// Substeps, and the rule for inputs between samples, where that was used in place of the twin's own.
    fn other_hold(&self) -> Option<Stepping> {
        let (_, own) = self.study.twin().integration()?;
        let used = self.found.evidence.base.step?.stepping;
        (used.hold != own.hold).then_some(used)
    }

    /// Lists what makes the diagnosis doubtful.
    fn warnings(
        &self,
        records: &[Record],
        parameters: &[FittedParameter],
        verdict: Verdict,
    ) -> Vec<Warning> {
        let twin = self.study.twin();
        let beliefs = self.watch.settings.beliefs(self.study);
        let elsewhere = start_elsewhere(twin, records, &beliefs);
        let mut all = warnings(
            twin,
            records,
            self.validation.map(|records| &records[0]),
            parameters,
            self.finer().is_some(),
            self.found.evidence.searched(),
        );
        all.extend(elsewhere.map(|start| Warning::elsewhere(&start, records.len())));
        all.extend((self.other_hold()).map(|stepping| Warning::hold(stepping, None)));
        if twin.outline().is_none() && verdict == Verdict::NoGap {
            // No check at all horizons looks at it: noise may have taken what it does not follow.
            let base = &self.found.evidence.base;
            let run = |record: &Record| base.model.base.free_run(&base.theta, record.drive());
            let outputs = &twin.signals().outputs;
            let remedy =
                "noise may hide what is missing: take a longer record, or a quieter sensor";
            let told = records.iter().filter_map(|record| {
                Some(Warning::no_better_of(outputs, record, &run(record).ok()?))
            });
            for doubt in told.flatten().map(|doubt| Warning { remedy, ..doubt }) {
                // Once of each output, whatever records show it.
                if !all.contains(&doubt) {
                    all.push(doubt);
                }
            }
        }
        all
    }

    /// Returns whether the answer names places and effects of a structural gap.
    fn tells_more(&self, answer: &Answer) -> bool {
        answer.verdict == Verdict::StructuralGap && !self.watch.settings.detection_only
    }

    /// The explanation by the accepted effects, if any were accepted.
    fn accepted(&self, answer: &Answer) -> Option<&Explanation> {
        let is_some = !answer.accepted.is_empty();
        is_some.then(|| self.found.known.get(&set(&answer.accepted)))?
    }

    /// Evidence for a gap, with a p-value from records that the twin simulates where that is asked for; and whether fewer than asked for
    /// were simulated, since the work was stopped.
    pub fn detection(&self) -> Result<(Detection, bool), StudyError> {
        let settings = self.watch.settings;
        let own = self.found.known.posterior().log_odds;
        let mut detection = Detection {
            log_evidence: own,
            p_value: None,
            simulations: 0,
            at_floor: false,
            alpha: settings.alpha,
        };
        if settings.calibrate == 0 {
            return Ok((detection, false));
        }
        let stage = self.watch.progress.stage("calibrate", settings.calibrate);
        let alone = DiagnoseSettings {
            detection_only: true,
            calibrate: 0,
            give_partial: false,
            ..settings.clone()
        };
        let unshown = self.watch.progress.unshown();
        let log_odds = |records: &[Record]| {
            let watch = Watch {
                settings: &alone,
                progress: &unshown,
            };
            let found = searched(self.study, records, watch)?;
            Ok(found.known.posterior().log_odds)
        };
        let model = &self.found.evidence.base.model;
        let noise = settings.noise().child("null");
        let (simulated, is_cut) = calibrate(model, settings, log_odds, noise, &stage)?;
        detection.simulations = match is_cut {
            true => simulated.len(),
            false => settings.calibrate,
        };
        if let Some((p, at_floor)) = p_value(own, &simulated) {
            (detection.p_value, detection.at_floor) = (Some(p), at_floor);
        }
        Ok((detection, is_cut))
    }

    /// The answer, and listed effects that absorb a parameter gap.
    fn answer(&self) -> Result<(Answer, Vec<EffectFit>), StudyError> {
        let (known, base) = (&self.found.known, &self.found.evidence.base);
        let settings = self.watch.settings;
        let (is_outside, within) = left_the_prior(&base.model, settings.alpha)?;
        let hypotheses = Hypotheses {
            has_equations: base.scales.has_equations(),
            ..known.hypotheses()
        };
        let mut answer = Answer::new(hypotheses.posterior(), is_outside);
        let mut explained = vec![];
        match (answer.verdict, within) {
            (Verdict::StructuralGap, _) if !settings.detection_only => answer = answer.decided(),
            (Verdict::ParameterGap, Some(within)) if !settings.detection_only => {
                let all = absorbing(&base.model, &within, &self.found.evidence.listed)?;
                if !all.is_empty() {
                    answer.decision = Decision::Absorbed;
                    answer.class = all.iter().flat_map(|e| e.last().keys()).collect();
                }
                explained = absorbed(&all, within.log_evidence, &answer.posterior);
            }
            _ => {}
        }
        let is_linearised = !base.scales.has_equations() && !base.is_silent;
        let accepted = self.accepted(&answer).and_then(|e| e.model.as_ref());
        if let Some(accepted) = accepted.filter(|_| is_linearised)
            && !is_nearer(accepted, &base.model)?
        {
            answer = answer.refuted();
        }
        Ok((answer, explained))
    }

    /// The answer once an all-clear has been checked: fitted noise may have swallowed what is missing.
    fn checked(&self, answer: Answer) -> Result<(Answer, Option<PredictiveCheck>), StudyError> {
        let settings = self.watch.settings;
        let is_clear = answer.verdict != Verdict::StructuralGap;
        if !is_clear || settings.detection_only || self.found.is_partial {
            return Ok((answer, None));
        }
        let model = &self.found.evidence.base.model;
        let noise = settings.noise().child("check");
        let fitted = std::slice::from_ref(&model.fitted);
        let draws = match model.problem.is_simulated() {
            true => PosteriorSample::default(),
            false => {
                let noise = noise.child("draws");
                posterior(&model.problem, fitted, DrawsAsked::Usual, noise)?
            }
        };
        let predictive = Predictive {
            model,
            declared: declared(self.study.twin(), &model.problem),
            is_open_loop: self.found.evidence.base.reacting.is_empty(),
            draws: &draws,
            noise,
        };
        let Some(check) = predictive.check()? else {
            return Ok((answer, None));
        };
        let Some(nothing) = check.nothing(self.found.evidence.base.noise_gain) else {
            return Ok((answer, Some(check)));
        };
        let (disturbance, places) = predictive.disturbance()?.unzip();
        let answer = answer.swallowed(nothing, places.unwrap_or_default());
        let check = PredictiveCheck {
            disturbance,
            ..check
        };
        Ok((answer, Some(check)))
    }

    /// Places, missing functions and residuals of a structural gap, and a sparse law for what is missing.
    fn location(
        &self,
        answer: &Answer,
        accepted: Option<&Model>,
    ) -> Result<(Location, Option<Discovery>), StudyError> {
        let known = &self.found.known;
        let targets = answer.posterior.targets();
        let places: Vec<&str> = (accepted.iter())
            .flat_map(|model| &model.terms)
            .map(|term| term.target.as_str())
            .collect();
        let target = answer.place();
        let class = match &target {
            Some(target) if places.iter().all(|place| *place == places[0]) => {
                TargetShare::alike(&targets, target)
            }
            _ => vec![],
        };
        let place = target.as_deref();
        let mut functions = missing_functions(&known.unknown(), known.twin(), place);
        if let Some(explanation) = self.accepted(answer)
            && let Some(beside) = known.beside(&explanation.set())
        {
            functions.extend(missing_functions(&beside, explanation, place));
        }
        let model = &self.found.evidence.base.model;
        let location = Location {
            maps: maps(model, known.best_model())?,
            after: accepted.map(|model| maps(model, None)).transpose()?,
            target,
            class,
            targets,
            functions,
            ..Location::default()
        };
        let discovery = self.discovery(answer, &location);
        Ok((location, discovery))
    }

    /// A sparse law for what is missing, where nothing listed explains it all.
    fn discovery(&self, answer: &Answer, location: &Location) -> Option<Discovery> {
        let known = &self.found.known;
        // The place that the answer states: of the gap, or of what remains beside the accepted effects.
        let (all, place): (Vec<&Explanation>, String) = match answer.decision {
            Decision::NoneOfThese => (known.unknown(), location.target.clone()?),
            Decision::Partial => (
                known.beside(&self.accepted(answer)?.set())?,
                remains(known, answer)?.place,
            ),
            _ => return None,
        };
        // The best function of one variable there. What a parameter follows is no law to be added.
        let (best, curve) = (all.into_iter())
            .filter(|e| e.last().target == place && !e.last().is_in_parameter())
            .find_map(|e| Some((e, curve(e.model.as_ref()?)?)))?;
        let noise = self.watch.settings.noise().child("discover");
        discover((&place, &best.last().variables[0].0), &curve, noise)
    }

    /// The next input, the smallest visible effects and the share closed.
    fn extent(
        &self,
        answer: &Answer,
        accepted: Option<&Model>,
        stage: &Stage,
    ) -> Result<Extent, StudyError> {
        let (known, model) = (&self.found.known, &self.found.evidence.base.model);
        let settings = self.watch.settings;
        let mut extent = Extent::default();
        let is_class = answer.decision == Decision::Class && answer.accepted.len() == 1;
        if is_class && !settings.quick {
            let rivals: Vec<&Model> = (answer.class.iter())
                .filter_map(|key| known.model(&set(std::slice::from_ref(key))))
                .collect();
            extent.next_input = next_input(&rivals, settings.noise().child("next"))?;
        }
        settings.ends(stage.tick())?;
        if !settings.quick {
            extent.power = power(model, &self.found.evidence.listed)?;
        }
        settings.ends(stage.tick())?;
        if !self.found.is_partial {
            let listed = known.listed().into_iter();
            let others: Vec<&Model> = listed.filter_map(|e| e.model.as_ref()).collect();
            let measures = Measures {
                base: model,
                accepted,
                others: &others,
                class: &answer.class,
                validation: self.validation,
                initial: settings.initial.as_deref(),
            };
            extent.shrinkage = shrinkage(&measures, settings.noise())?;
        }
        settings.ends(stage.tick())?;
        Ok(extent)
    }

    /// Free runs of the twin and of the accepted model beside records.
    fn free_runs(
        &self,
        records: &[Record],
        accepted: Option<&Model>,
    ) -> Result<FreeRuns, StudyError> {
        let runner = |model: &Model| {
            let problem = model.problem.on(records);
            Runner::new(&problem, &problem.full(&model.theta()))
        };
        let base = runner(&self.found.evidence.base.model)?;
        let grown = accepted.map(runner).transpose()?.flatten();
        Ok(free_runs(&records[0], base.as_ref(), grown.as_ref()))
    }
}

/// The set of these effects.
fn set(keys: &[String]) -> TermSet {
    keys.iter().cloned().collect()
}

/// Returns whether the free run of a noisy black box's model is nearer to the record than that of the twin. Their likelihood is linearised
/// about their runs, and says nothing where these are in another phase.
fn is_nearer(model: &Model, twin: &Model) -> Result<bool, StudyError> {
    let error = |model: &Model| -> Result<f64, StudyError> {
        let runner = Runner::new(&model.problem, &model.fitted.theta)?;
        let errors = runner.and_then(|runner| runner.errors(&model.problem.records[0], 0));
        Ok(errors.map_or(f64::INFINITY, |errors| root(&errors)))
    };
    Ok(error(model)? < THRESHOLDS.nearer * error(twin)?)
}
