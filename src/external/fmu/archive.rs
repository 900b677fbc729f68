//! The archive that an FMU is.

use super::description::{Interface, ModelDescription};
use super::unpack::{MOST_BYTES, unpack};
use super::variable::Version;
use crate::storage::files::with_remedy;
use crate::storage::untrusted::read;
use crate::study::StudyError;
use fmi::fmi2::import::Fmi2Import;
use fmi::fmi3::import::Fmi3Import;
use fmi::traits::FmiImport;
use std::fs::File;
use std::path::Path;
use tempfile::TempDir;

/// Longest description, in bytes: a hundred thousand variables take half of it.
const MOST_DESCRIPTION: u64 = 1 << 26;

/// An unpacked FMU; the folder goes with the value.
pub(super) enum Archive {
    Two(Fmi2Import),
    Three(Fmi3Import),
}

/// Unpacks an FMU into a temporary folder and reads its description, that of its own steps where `stepped` asks for them.
pub(super) fn open(path: &Path, stepped: bool) -> Result<(ModelDescription, TempDir), StudyError> {
    let at = |problem: String| {
        // Some problems say how it is to be exported.
        let again = if problem.contains("; export it") {
            ""
        } else {
            "; export it again"
        };
        refused(path, format!("no usable FMU: {problem}{again}"))
    };
    let file = File::open(path).map_err(|error| refused(path, with_remedy(&error)))?;
    if path.is_dir() {
        let error = std::io::ErrorKind::IsADirectory.into();
        return Err(refused(path, with_remedy(&error)));
    }
    let folder = tempfile::Builder::new().prefix("truetwin-fmu-").tempdir();
    let folder = folder.map_err(|error| at(format!("no temporary folder: {error}")))?;
    unpack(file, folder.path(), MOST_BYTES).map_err(at)?;
    let bytes = read(
        &folder.path().join("modelDescription.xml"),
        MOST_DESCRIPTION,
    )
    .map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => at("it holds no modelDescription.xml".into()),
        _ => at(format!("modelDescription.xml: {error}")),
    })?;
    let description = ModelDescription::parse(&text(bytes), stepped).map_err(|problem| {
        let problem = format!("modelDescription.xml: {problem}");
        at(problem)
    })?;
    Ok((description, folder))
}

/// UTF-8, or else Latin-1, which some tools write.
fn text(bytes: Vec<u8>) -> String {
    match String::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => error.into_bytes().into_iter().map(char::from).collect(),
    }
}

impl Archive {
    /// Ready to be instantiated. The library's loader is given the few attributes that it needs: its own reader refuses
    /// descriptions with units.
    pub fn new(description: &ModelDescription, folder: TempDir) -> Result<Self, fmi::Error> {
        let ModelDescription {
            version,
            interface,
            version_text,
            name,
            token,
            identifier,
            ..
        } = description;
        let token_name = match version {
            Version::Two => "guid",
            Version::Three => "instantiationToken",
        };
        let kind = match interface {
            Interface::ModelExchange => "ModelExchange",
            Interface::CoSimulation => "CoSimulation",
        };
        let [version_text, name, token, identifier] =
            [version_text, name, token, identifier].map(|text| escaped(text));
        let text = format!(
            "<fmiModelDescription fmiVersion=\"{version_text}\" modelName=\"{name}\" {token_name}=\"{token}\">\
             <{kind} modelIdentifier=\"{identifier}\"/><ModelVariables/><ModelStructure/></fmiModelDescription>"
        );
        Ok(match version {
            Version::Two => Self::Two(Fmi2Import::new(folder, &text)?),
            Version::Three => Self::Three(Fmi3Import::new(folder, &text)?),
        })
    }

    /// Returns whether the library can be told that a step is complete.
    pub fn hears_of_steps(&self, identifier: &str) -> bool {
        match self {
            Self::Two(import) => (import.binding(identifier))
                .is_ok_and(|library| library.fmi2CompletedIntegratorStep.is_ok()),
            Self::Three(import) => (import.binding(identifier))
                .is_ok_and(|library| library.fmi3CompletedIntegratorStep.is_ok()),
        }
    }

    /// A function of the standard that the library lacks, if there is one.
    pub fn lacks(
        &self,
        identifier: &str,
        interface: Interface,
    ) -> Result<Option<&'static str>, fmi::Error> {
        macro_rules! missing {
            ($binding:expr, $($function:ident),*) => {
                [$((stringify!($function), $binding.$function.is_err())),*].to_vec()
            };
        }
        let is_exchange = interface == Interface::ModelExchange;
        let (mut functions, own) = match self {
            Self::Two(import) => {
                let library = import.binding(identifier)?;
                let all = missing!(
                    library,
                    fmi2Instantiate,
                    fmi2FreeInstance,
                    fmi2SetupExperiment,
                    fmi2EnterInitializationMode,
                    fmi2ExitInitializationMode,
                    fmi2Reset,
                    fmi2SetReal,
                    fmi2GetReal
                );
                let exchange = missing!(
                    library,
                    fmi2EnterEventMode,
                    fmi2NewDiscreteStates,
                    fmi2EnterContinuousTimeMode,
                    fmi2SetTime,
                    fmi2SetContinuousStates,
                    fmi2GetDerivatives,
                    fmi2GetEventIndicators,
                    fmi2GetContinuousStates
                );
                let step = missing!(library, fmi2DoStep);
                (all, if is_exchange { exchange } else { step })
            }
            Self::Three(import) => {
                let library = import.binding(identifier)?;
                let all = missing!(
                    library,
                    fmi3FreeInstance,
                    fmi3EnterInitializationMode,
                    fmi3ExitInitializationMode,
                    fmi3Reset,
                    fmi3SetFloat64,
                    fmi3GetFloat64
                );
                let exchange = missing!(
                    library,
                    fmi3InstantiateModelExchange,
                    fmi3EnterEventMode,
                    fmi3UpdateDiscreteStates,
                    fmi3EnterContinuousTimeMode,
                    fmi3SetTime,
                    fmi3SetContinuousStates,
                    fmi3GetContinuousStateDerivatives,
                    fmi3GetEventIndicators,
                    fmi3GetContinuousStates
                );
                let step = missing!(library, fmi3InstantiateCoSimulation, fmi3DoStep);
                (all, if is_exchange { exchange } else { step })
            }
        };
        functions.extend(own);
        let found = functions.into_iter().find(|(_, missing)| *missing);
        Ok(found.map(|(name, _)| name))
    }
}

fn escaped(text: &str) -> String {
    (text.replace('&', "&amp;").replace('<', "&lt;")).replace('"', "&quot;")
}

/// Creates the error of a file; the problem says what is wrong and what to do.
pub(super) fn refused(path: &Path, problem: impl std::fmt::Display) -> StudyError {
    StudyError::Simulator(format!("{}: {problem}", path.display()))
}
