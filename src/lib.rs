//! # truetwin
//!
//! A simulator ("digital twin") is fitted to the one real system in front of you, told when it cannot be trusted, and
//! calibrated where its training never went.
//!
//! ```text
//! prior ─ simulate ─▶ bank ─ features ─▶ train ─▶ estimator            pretrain, once
//! record ─ features ─▶ estimator ─▶ θ_init ─▶ gate ─ consistent ─▶ θ̂      estimate, each record
//!                                              │ not
//!                        Gauss–Newton ─▶ cloud of simulations ─▶ tuned heads ─▶ θ̂ ─▶ gate again
//! ```
//!
//! | to … | look at |
//! |---|---|
//! | plug in a simulator | [`twin::StateSpace`], [`twin::DigitalTwin`] |
//! | plug in a program written in any language | [`external::program`] |
//! | say what records look like and which recipe to use | [`study::Study`] |
//! | fill a bank on disk, from many processes | [`shards::BankPlan`], [`work`] |
//! | train, save, load, estimate | [`two_stage::pretrain`], [`two_stage::Estimator`] |
//! | compress records otherwise | [`feature::FeatureMap`], [`feature::FeatureRecipe`] |
//! | shape the network | [`network::HeadArchitecture`] |
//! | learn what a twin lacks | [`diagnose::diagnose`] |
//! | try a diagnosis where the truth is sealed | [`withheld::Withheld`] |
//! | add an effect that a twin lacks | [`effect`], [`twin::augment`] |
//! | give a twin the whole command line | [`cli::run`] |
//!
//! The library never prints, never exits and sets no global thread pool; long work reports to a
//! [`progress::Progress`] and can be cancelled through it. Source of the method: Lakshminarayanan, Guerrero & Rojas,
//! "Fine-Tuning a Simulation-Driven Estimator".

// The library never prints and never panics on data; tests may.
#![cfg_attr(
    not(test),
    warn(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)
)]

// Layers, lowest first; a module uses only what stands above it here (tests/layering.rs holds it so).
pub mod files;
mod foreign;
pub mod math;
pub mod optimise;
pub mod progress;
pub mod work;

pub mod twin;

pub mod filter;

pub mod feature;
pub mod network;

pub mod twins;

pub mod effect;

pub mod bank;
pub mod gate;
pub mod refine;
pub mod sample;
pub mod study;

pub mod external;
pub mod shards;

pub mod two_stage;

pub mod baseline;
pub mod diagnose;

pub mod experiment;
pub mod withheld;

pub mod report;

pub mod cli;

#[cfg(doctest)]
mod book;
