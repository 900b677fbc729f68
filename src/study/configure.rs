//! A study in the setting of a file: its tables change the twin and the plan.

use super::{Library, RecordPlan, RecordTable, Study, StudyError, StudyFile};
use crate::effect::{Effect, EffectKey, augment};
use crate::setting::number;
use crate::twin::{
    Adaptation, Integrator, MOST_SUBSTEPS, NoiseLevel, Role, Stepping, TOLERANCES, Twin, TwinError,
    adapt, fix,
};
use std::collections::BTreeMap;

impl Study {
    /// The study in the setting of a file about the same twin. θ becomes: the twin's parameters that are not fixed,
    /// unknown noise levels, unknown starts, effects' magnitudes that are not given. Of a file before, the plan of records stays alone.
    pub fn configure(&self, file: &StudyFile) -> Result<Self, StudyError> {
        (self.configured(file)).map_err(|error| file.located(error))
    }

    fn configured(&self, file: &StudyFile) -> Result<Self, StudyError> {
        if file.twin != self.name {
            return Err(StudyError::Twin {
                given: file.twin.clone(),
                known: self.name.clone(),
            });
        }
        // Boxes of magnitudes apply once the effects are added; all others before.
        let of_effects = |name: &str| name.parse::<EffectKey>().is_ok();
        let part = |boxes: &BTreeMap<String, _>, effects: bool| {
            (boxes.iter())
                .filter(|(name, _)| of_effects(name) == effects)
                .map(|(name, value)| (name.clone(), *value))
                .collect()
        };
        let plan = self.plan_of(&file.record)?;
        let declares = |level: &NoiseLevel| matches!(level, NoiseLevel::Declared(_));
        let step = match &plan {
            Some(plan) => plan.step,
            None if !file.noise.levels.values().any(declares) => 1.0,
            None => return Err(StudyError::NoPlan),
        };
        for (table, boxes) in [("prior", &file.prior.boxes), ("bounds", &file.bounds)] {
            if let Some(name) = boxes.keys().find(|name| file.fixed.contains_key(*name)) {
                return Err(StudyError::Twice {
                    name: name.clone(),
                    table,
                });
            }
        }
        self.check_library(&file.library)?;
        let first = Adaptation {
            prior: part(&file.prior.boxes, false),
            bounds: part(&file.bounds, false),
            limits: file.limits.clone(),
            noise: (file.noise).entries(self.base.outline().as_ref())?,
            start: file.start.clone(),
        };
        let second = Adaptation {
            prior: part(&file.prior.boxes, true),
            bounds: part(&file.bounds, true),
            ..Adaptation::default()
        };
        let effects = (file.effect.iter().enumerate())
            .map(|(index, entry)| {
                (self.catalogue.resolve(entry)).map_err(|error| file.effect_error(index, error))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let mut twin = adapt(self.stepped(&file.record)?, &first, step)
            .map_err(|error| self.naming_magnitudes(error, &effects))?;
        twin =
            augmented(&twin, &effects).map_err(|(index, error)| file.effect_error(index, error))?;
        if second != Adaptation::default() {
            twin = adapt(twin, &second, step)?;
        }
        let space = twin.parameters();
        for (name, &value) in &file.fixed {
            let position = space.position(name);
            (position.and_then(|at| space[at].check_value(value))).map_err(|error| {
                StudyError::Fixed {
                    name: name.clone(),
                    error,
                }
            })?;
        }
        let mut held = file.fixed.clone();
        held.extend(effects.iter().flat_map(Effect::given_by_parameter));
        twin = fix(twin, &held)?;
        if let Some(plan) = &plan {
            plan.check(&twin.signals())?;
        }
        (file.record.columns.check(&twin.signals())).map_err(StudyError::Plan)?;
        Ok(Self {
            twin,
            plan,
            file: file.with_equations_of(&self.file),
            ..self.clone()
        })
    }

    /// Returns the plan of the study with what a file changes in it.
    fn plan_of(&self, record: &RecordTable) -> Result<Option<RecordPlan>, StudyError> {
        let own = self.plan.as_ref();
        let step = record.step.or(own.map(|plan| plan.step));
        let samples = record.samples.or(own.map(|plan| plan.samples));
        let input = (record.input.clone()).or_else(|| own?.input.clone());
        match (step, samples) {
            (Some(step), Some(samples)) => Ok(Some(RecordPlan {
                step,
                samples,
                input,
                first_time: own.map_or(0.0, |plan| plan.first_time),
            })),
            _ if record.is_plan() => Err(StudyError::NoPlan),
            _ => Ok(None),
        }
    }

    /// Returns the twin as registered, with the integrator, the substeps and the hold of a file.
    pub(super) fn stepped(&self, record: &RecordTable) -> Result<Twin, StudyError> {
        let RecordTable {
            integrator,
            substeps,
            hold,
            tolerance,
            ..
        } = *record;
        let hold = hold.or(self.hold);
        let given = [
            (substeps.is_some(), "substeps"),
            (integrator.is_some(), "integrator"),
            (hold.is_some(), "hold"),
            (tolerance.is_some(), "tolerance"),
        ];
        let Some((_, key)) = given.into_iter().find(|(is_given, _)| *is_given) else {
            return Ok(self.base.clone());
        };
        if let Some(n) = substeps.filter(|n| !(1..=MOST_SUBSTEPS).contains(n)) {
            return Err(StudyError::Plan(format!(
                "substeps = {n}; choose between 1 and {MOST_SUBSTEPS}"
            )));
        }
        if let Some(tolerance) = tolerance.filter(|share| !TOLERANCES.contains(share)) {
            return Err(StudyError::Plan(format!(
                "tolerance = {}; choose a share between {:e} and {}",
                number(tolerance),
                TOLERANCES.start(),
                TOLERANCES.end()
            )));
        }
        let is_discrete = |rule: Integrator| rule == Integrator::Discrete;
        if let Some((own, _)) = self.base.integration() {
            let wrong = match integrator {
                Some(rule) => is_discrete(rule) != is_discrete(own),
                None => is_discrete(own),
            };
            if wrong || is_discrete(own) && (substeps, hold, tolerance) != (None, None, None) {
                return Err(StudyError::Plan(format!(
                    "{key}: {}",
                    match is_discrete(own) {
                        true =>
                            "the twin moves from sample to sample, with nothing between; remove it",
                        false =>
                            "the twin has rates, and no next values; choose another integrator",
                    }
                )));
            }
            let rule = integrator.unwrap_or(own);
            if tolerance.is_some() && !rule.is_adaptive() {
                return Err(StudyError::Plan(
                    "tolerance: the integrator takes steps of one length; remove it, or choose adaptive or stiff"
                        .into(),
                ));
            }
        }
        let change = |rule: &mut Integrator, stepping: &mut Stepping| {
            *rule = integrator.unwrap_or(*rule);
            stepping.hold = hold.unwrap_or(stepping.hold);
            stepping.substeps = substeps.unwrap_or(stepping.substeps);
            stepping.tolerance = tolerance.unwrap_or(stepping.tolerance);
        };
        self.base.stepped(change).ok_or_else(|| {
            StudyError::Plan(format!(
                "{key} needs the twin's equations, which a black box does not show; remove it"
            ))
        })
    }

    /// Adds the magnitudes of the file's effects to the names that an unknown name in `[prior]` or `[bounds]` is told.
    fn naming_magnitudes(&self, error: TwinError, effects: &[Effect]) -> TwinError {
        match (error, augment(self.base.clone(), effects.to_vec())) {
            (TwinError::UnknownIn { table, name, known }, Ok(twin))
                if matches!(table, "prior" | "bounds") =>
            {
                let space = twin.parameters();
                let magnitudes = space.iter().filter(|p| p.role == Role::Magnitude);
                let known = magnitudes.fold(known, |known, p| format!("{known}, {}", p.name));
                TwinError::UnknownIn { table, name, known }
            }
            (error, _) => error,
        }
    }

    fn check_library(&self, library: &Library) -> Result<(), StudyError> {
        let mut named = library.only.iter().chain(&library.without);
        if let Some(unknown) = named.find(|name| !self.knows_effect(name)) {
            return Err(StudyError::UnknownEffect {
                name: unknown.as_str().into(),
                near: self.nearest_effect(unknown),
            });
        }
        // Which effects a twin can have is asked of it: of a program, too.
        let is_both = !library.only.is_empty() && !library.without.is_empty();
        match is_both && library.contradicts_itself(&self.effects()) {
            true => Err(StudyError::NoEffects),
            false => Ok(()),
        }
    }
}

/// Adds effects to a twin; an error comes with the index of the first effect that cannot be added.
fn augmented(twin: &Twin, effects: &[Effect]) -> Result<Twin, (usize, TwinError)> {
    (1..=effects.len()).try_fold(twin.clone(), |_, n| {
        augment(twin.clone(), effects[..n].to_vec()).map_err(|error| (n - 1, error))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Hold;
    use crate::twin::fixture::AtOnce;
    use crate::twins::CascadedTanks;

    fn refused(tables: &str) -> String {
        let text = format!("twin = 'tanks'\n{tables}");
        let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
        let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
        let study = Study::new("tanks", CascadedTanks, plan).unwrap();
        study.configure(&file).unwrap_err().to_string()
    }

    #[test]
    fn an_unknown_name_lists_parameters_and_magnitudes() {
        let effect = "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'\n";
        let message = refused(&format!("[prior]\nk9 = [0.0, 1.0]\n{effect}"));
        for name in ["k9", "k1, k2, k3, k4", "sensor-lag@sensor.tau"] {
            assert!(message.contains(name), "{message}");
        }
    }

    #[test]
    fn the_hold_of_the_twins_own_file_stays_under_another_study() {
        let text = "[twin]\nname = 'tank'\n[parameters]\nk = { prior = [0.2, 1.0] }\n\
            [states]\nh = { rate = 'u - k*h', start = 1.0 }\n[inputs]\nu = {}\n\
            [outputs]\ny = { value = 'h', noise = 0.02 }\n[record]\nhold = 'linear'\n";
        let parse = |text: &str| StudyFile::parse(text, "s.toml".as_ref()).unwrap();
        for (own, asks) in [
            ("", true),
            ("hold = 'nearest'", false),
            ("hold = 'impulse'", true),
        ] {
            let of_input = text.replace("u = {}", &format!("u = {{ {own} }}"));
            let of_input = of_input.replace("[record]\nhold = 'linear'\n", "");
            let study = Study::of_file(&parse(&of_input)).unwrap();
            assert_eq!(study.asks_hold(), asks, "{own}");
        }
        let file = parse(text);
        let served = Study::of_file_with(&file, file.own_equations().unwrap().clone());
        for study in [Study::of_file(&file).unwrap(), served.unwrap()] {
            for (record, hold) in [("", Hold::Linear), ("[record]\nhold = 'zero'", Hold::Zero)] {
                let other = format!("twin = 'tank'\n[prior]\nk = [0.3, 0.9]\n{record}");
                let configured = study.configure(&parse(&other)).unwrap();
                assert_eq!(configured.twin().integration().unwrap().1.hold, hold);
                assert!(!configured.asks_hold(), "nothing is asked that is said");
            }
        }
    }

    #[test]
    fn substeps_have_a_range_and_need_equations() {
        for n in ["0", "1000000000"] {
            let message = refused(&format!("[record]\nsubsteps = {n}"));
            let expected = format!("s.toml, line 3: substeps = {n}; choose between 1 and 1000");
            assert_eq!(message, expected);
        }
        let plan = RecordPlan::levels(0.5, 60, 0.0, 3.0, 30);
        let study = Study::new("boxed", AtOnce::<1>(|a, u| a[0] * u), plan).unwrap();
        for key in ["hold = 'linear'", "integrator = 'euler'", "substeps = 2"] {
            let text = format!("twin = 'boxed'\n[record]\n{key}");
            let file = StudyFile::parse(&text, "s.toml".as_ref()).unwrap();
            let message = study.configure(&file).unwrap_err().to_string();
            let name = key.split(' ').next().unwrap();
            let expected = format!("s.toml, line 3: {name} needs");
            assert!(message.starts_with(&expected), "{message}");
            assert!(message.ends_with("remove it"), "{message}");
        }
    }

    #[test]
    fn a_wrong_effect_is_named_by_its_line() {
        let first = "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'\n";
        for (second, expected) in [
            (
                "id = 'lagg'\ntarget = 'sensor'",
                "line 6: unknown effect id \"lagg\"",
            ),
            (
                "id = 'state-ceiling'\ntarget = 'h9'\nto = 'h2'",
                "line 7: effect state-ceiling: the twin has no state \"h9\"",
            ),
            (
                "id = 'state-ceiling'\ntarget = 'h1'\nto = 'h9'",
                "line 8: effect state-ceiling: the twin has no state \"h9\"",
            ),
            (
                "id = 'sensor-bias'\ntarget = 'sensor'\nfrom = 'h1'",
                "line 8: effect sensor-bias has no from",
            ),
            (
                "id = 'sensor-lag'\ntarget = 'sensor'",
                "line 7: effect sensor-lag on sensor is given twice",
            ),
            (
                "id = 'sensor-bias'\ntarget = 'sensor'\nmagnitudes = { ofset = 1 }",
                "line 8: effect sensor-bias has no magnitude \"ofset\"",
            ),
            (
                "id = 'sensor-bias'\ntarget = 'sensor'\n[effect.magnitudes]\noffset = nan",
                "line 9: effect sensor-bias: offset = NaN",
            ),
        ] {
            let message = refused(&format!("{first}[[effect]]\n{second}\n"));
            assert!(
                message.starts_with(&format!("s.toml, {expected}")),
                "{message}"
            );
        }
    }

    #[test]
    fn a_parameter_in_two_tables_is_refused() {
        let message = refused("[fixed]\nk1 = 0.5\n[bounds]\nk1 = [0.1, 1.0]");
        let expected = "s.toml, line 5: k1 appears in both fixed and bounds; remove one";
        assert_eq!(message, expected);
    }

    #[test]
    fn a_wrong_value_is_told_by_its_line() {
        for (tables, line, problem) in [
            ("[record]\nsubsteps = 2\nstep = -1.0", 4, "step = -1"),
            ("[prior]\n\nk1 = [0.2, 9.0]", 4, "prior [0.2, 9] of k1"),
            ("[bounds]\nk1 = [0.7, 0.9]", 3, "prior [0.4, 0.8] of k1"),
            ("[fixed]\nk2 = 0.5\nk1 = -5.0", 4, "fixed: k1 = -5"),
            ("[fixed]\nk7 = 1.0", 3, "fixed: no parameter is called k7"),
            ("[noise]\ny = 0.1\nh1 = nan", 4, "noise h1 = NaN"),
            ("[start]\nh9 = 1.0", 3, "start names h9"),
            ("[noise]\nprocess = 3.0", 3, "noise process = 3; process is"),
            (
                "[record.columns]\nyy = 'level'",
                2,
                "columns: no channel is called \"yy\"",
            ),
            (
                "[record]\nstep = 1.0\nsamples = 50\n[record.input]\n\nu = { levels = [0.0, 1.0], hold = 0 }",
                7,
                "input u: hold = 0",
            ),
            (
                "[[effect]]\nid = 'sensor-lag'\ntarget = 'sensor'\n[bounds]\n'sensor-lag@sensor.tau' = [-2.0, 3.0]",
                6,
                "bounds sensor-lag@sensor.tau = -2; the law's own limits",
            ),
            (
                "[library]\n\nwithout = [\n'sensor-lag',\n'foo']",
                6,
                "library: foo",
            ),
            (
                "[library]\nonly = ['sensor-lag@sensor']\nwithout = ['sensor-lag']",
                3,
                "library: without names all of only",
            ),
            (
                "[start]\nh1 = { value = 1.0, at = 0.0 }\nh2 = { value = 1.0, at = -2.0 }",
                4,
                "start h2: at = -2, and 0 for another state",
            ),
        ] {
            let expected = format!("s.toml, line {line}: {problem}");
            let message = refused(tables);
            assert!(message.starts_with(&expected), "{message}");
        }
    }
}
