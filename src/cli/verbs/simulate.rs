//! `simulate`: simulates a record.

use crate::cli::prelude::*;
use crate::effect::{Effect, augment};
use crate::record::{Drive, Record, Signal, named_csv_text};
use crate::setting::{count, did_you_mean};
use crate::twin::{Noise, Parameter, ParameterSpace, Role, Twin};
use std::collections::BTreeMap;

/// Simulate a record at given parameters, with noise and optional effects.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
        truetwin simulate --twin van-der-pol --theta nu=3 --out R.csv\n  \
        truetwin simulate --twin tanks --theta k1=0.6,k2=0.5,k3=0.55,k4=1 --effect E.toml --seed 4 --out R.csv\n\
        Next: truetwin estimate R.csv --estimator EST, or truetwin diagnose R.csv --twin NAME --out gap")]
pub(in crate::cli) struct Simulate {
    #[command(flatten)]
    subject: Subject,
    #[command(flatten)]
    columns: FileColumns,
    /// Parameters as name=value, separated by commas; estimated starts and noise levels may be omitted.
    #[arg(long, value_name = "a=..,b=..")]
    theta: String,
    /// TOML file of [[effect]] tables to add.
    #[arg(long, value_name = "E.toml")]
    effect: Option<PathBuf>,
    /// Time and inputs [default: random levels as in the study].
    #[arg(long, value_name = "U.csv")]
    input: Option<PathBuf>,
    /// Simulate without process and measurement noise.
    #[arg(long)]
    noise_free: bool,
    /// Output file of the record [default: standard output].
    #[arg(long, value_name = "R.csv")]
    out: Option<PathBuf>,
}

impl Verb for Simulate {
    fn run(&self, context: &Context<'_>) -> Result<ExitCode, Failure> {
        if let Some(out) = &self.out {
            records::check_new(out)?;
        }
        self.columns
            .check_used(self.input.is_some(), "--input U.csv")?;
        let study = context.study(&self.subject)?;
        let given = parse_theta(&self.theta)?;
        let mut twin = study.twin().clone();
        let mut magnitudes = BTreeMap::new();
        let noise = Noise::new(context.seed, "simulate", 0);
        let drive = match &self.input {
            Some(path) => self.columns.reader(&study).drive(path)?,
            None => study.drives()?.draw(noise)?,
        };
        if let Some(path) = &self.effect {
            let effects = study.catalogue().read(path, drive.dt())?;
            let is_own = |effect: &&Effect| study.has_effect(effect.key());
            if let Some(effect) = effects.iter().find(is_own) {
                let (file, key) = (path.display(), effect.key());
                return Err(Failure::user(format!(
                    "{file}: the study has {key} already; give it in one of the two"
                )));
            }
            magnitudes.extend(effects.iter().flat_map(Effect::given_by_parameter));
            twin = augment(twin, effects).in_file(path)?;
        }
        if let Some(name) = given
            .keys()
            .find(|name| study.file().fixed.contains_key(*name))
        {
            return Err(wrong_theta(format!(
                ": the study file fixes \"{name}\"; leave it out here, or there"
            )));
        }
        let theta = complete(&twin.parameters(), &given, &magnitudes)?;
        self.check_inputs(&twin, &drive)?;
        let noise = if self.noise_free { Noise::OFF } else { noise };
        let outputs = twin.simulate(&theta, &drive, noise)?;
        let record = Record::complete(drive, outputs)?;
        let signals = twin.signals();
        record.check_channels(&signals)?;
        let names = study.file().record.columns.header(&signals);
        if let Some(out) = &self.out {
            write_result(out, |path| {
                Ok::<_, Failure>(record.write_named(path, &names)?)
            })?;
        }
        let rows = |of: &Signal| -> Option<Vec<Vec<f64>>> {
            let rows = of.rows().into_iter().map(|row| row.to_vec());
            self.out.is_none().then(|| rows.collect())
        };
        let times = || (0..record.samples()).map(|k| record.drive().own_time(k));
        let json = json!({
            "schema": "truetwin.simulate/1", "twin": study.name(),
            "names": twin.parameters().names(), "theta": theta,
            "seed": context.seed, "noise_free": self.noise_free,
            "samples": record.samples(), "step": record.drive().dt(), "record": self.out.as_deref().map(output::name),
            "t": self.out.is_none().then(|| times().collect::<Vec<_>>()),
            "u": rows(record.drive().inputs()), "y": rows(record.outputs()),
        });
        let text = || match &self.out {
            Some(_) => String::new(),
            None => named_csv_text(&record, &names),
        };
        Provenance::new(context)
            .files("input", &self.input)
            .files("effect", &self.effect)
            .print_beside(context, json, text)
    }
}

impl Simulate {
    fn check_inputs(&self, twin: &Twin, drive: &Drive) -> Result<(), Failure> {
        let (given, expected) = (drive.inputs().ncols(), twin.signals().inputs.len());
        let Some(path) = &self.input else {
            return Ok(twin.check_drive(drive)?);
        };
        if given == expected {
            return twin.check_drive(drive).in_file(path);
        }
        Err(Failure::user(format!(
            "{}: {}, the twin has {expected}; give t and one column for each input",
            path.display(),
            count(given, "input")
        )))
    }
}

/// Creates the failure of a wrong `--theta`.
fn wrong_theta(problem: String) -> Failure {
    Failure::user(format!("--theta{problem}"))
}

/// Parses `a=1,b=2`.
fn parse_theta(text: &str) -> Result<BTreeMap<String, f64>, Failure> {
    let mut values = BTreeMap::new();
    for part in text.split(',').map(str::trim).filter(|p| !p.is_empty()) {
        let pair = part.split_once('=');
        let pair = pair.and_then(|(name, value)| Some((name.trim(), value.trim().parse().ok()?)));
        let (name, value) = pair.ok_or_else(|| {
            wrong_theta(format!(
                ": \"{part}\" is not name=value; write k=0.5, with commas between"
            ))
        })?;
        if values.insert(name.to_owned(), value).is_some() {
            return Err(wrong_theta(format!(" gives {name} twice; give it once")));
        }
    }
    Ok(values)
}

/// Returns θ from the call and the effect file; omitted starts and noise levels take their prior's centre.
fn complete(
    space: &ParameterSpace,
    given: &BTreeMap<String, f64>,
    magnitudes: &BTreeMap<String, f64>,
) -> Result<Vec<f64>, Failure> {
    let names = space.names();
    let all = match names.is_empty() {
        true => "none".into(),
        false => names.join(", "),
    };
    if let Some(name) = given.keys().find(|name| !names.contains(&name.as_str())) {
        return Err(wrong_theta(format!(
            ": no parameter is called \"{name}\"{}; there are {all}",
            did_you_mean(name, &names),
        )));
    }
    let missing = || -> Vec<&str> {
        let needed = (space.iter()).filter(|p| !matches!(p.role, Role::Start | Role::Noise));
        let names = needed.map(|p| p.name.as_str());
        names
            .filter(|name| !given.contains_key(*name) && !magnitudes.contains_key(*name))
            .collect()
    };
    let value = |p: &Parameter| match (given.get(&p.name), magnitudes.get(&p.name), p.role) {
        (Some(_), Some(_), _) => Err(wrong_theta(format!(
            ": the effect file gives {} already; give it in one of the two",
            p.name
        ))),
        (Some(value), None, _) => match p.check_value(*value) {
            Ok(()) => Ok(*value),
            Err(error) => Err(wrong_theta(format!(": {error}"))),
        },
        // The effect has checked its limits; off values may be infinite.
        (None, Some(magnitude), _) => Ok(*magnitude),
        (None, None, Role::Start | Role::Noise) => Ok(p.prior.centre()),
        (None, None, _) => Err(wrong_theta(format!(
            ": no value for {}; give {}",
            p.name,
            missing().join(", ")
        ))),
    };
    space.iter().map(value).collect()
}
