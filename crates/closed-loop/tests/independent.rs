//! Worlds that another program made: its own motion, projection, effects and noise.
//!
//! `fixtures/oracles/worlds/make_worlds.py` shares the design's equations with this project and nothing
//! else. Each effect acts with 8 to 12 times the bound that it computes; `truth.json` says what acts.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use closed_loop::{Questions, close, close_asking};
use serde::Deserialize;
use telemetry::report::{FoundEffect, Report, Selector, Verdict};
use telemetry::{Bundle, Model};

/// What acts in one world.
#[derive(Debug, Deserialize)]
struct Truth {
    /// Id of the effect; none where nothing acts, or what acts is in no catalogue.
    effect: Option<String>,
    #[serde(default)]
    selectors: BTreeMap<String, Selector>,
    #[serde(default)]
    parameters: BTreeMap<String, f64>,
    /// Variables that an honest answer may name first, where what acts is in no catalogue.
    #[serde(default)]
    follows: Vec<String>,
}

fn worlds() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/oracles/worlds")
}

fn truths() -> BTreeMap<String, Truth> {
    let text = std::fs::read_to_string(worlds().join("truth.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn report(name: &str) -> Report {
    let bundle = Bundle::read(&worlds().join(name)).unwrap();
    let model = Model::read(&worlds().join(name).join("model.toml")).unwrap();
    close(&model, &bundle, &|_| ()).unwrap().report
}

/// How many sigmas each parameter is off; an instant has bounds instead.
fn off(found: &FoundEffect, truth: &Truth) -> Vec<(String, f64)> {
    let of = |(name, value): (&String, &f64)| {
        let estimate = found.parameters.get(name)?;
        if let Some([low, high]) = estimate.interval {
            let outside = f64::max(low - value, value - high).max(0.0);
            return Some((name.clone(), 4.0 * outside / (high - low)));
        }
        Some((name.clone(), (estimate.value - value) / estimate.sigma?))
    };
    truth.parameters.iter().filter_map(of).collect()
}

/// The effect that acts is named, alone, with all it acts on; every parameter lies within 4 sigmas of the
/// truth, which one of some forty does not in one trial of 400.
#[test]
fn what_acts_is_named_with_its_size() {
    let mut compared = 0;
    for (name, truth) in truths() {
        let Some(id) = &truth.effect else { continue };
        let report = report(&name);
        let [found] = report.effects.as_slice() else {
            panic!("{name}: {id} acts, found {:?}", report.effects);
        };
        assert_eq!(&found.id, id, "{name}");
        assert_eq!(report.verdict, Verdict::Explained, "{name}");
        for (key, value) in &truth.selectors {
            assert_eq!(found.selectors.get(key), Some(value), "{name}: {key}");
        }
        for (parameter, off) in off(found, &truth) {
            assert!(off.abs() < 4.0, "{name}: {parameter} is {off} sigmas off");
            compared += 1;
        }
    }
    assert!(compared > 20, "{compared} parameters");
}

/// Nothing is named where nothing acts, with the declared noise wrong by a fifth, too.
#[test]
fn nothing_is_named_where_nothing_acts() {
    let nulls = truths().into_iter();
    for (name, _) in nulls.filter(|(_, t)| t.effect.is_none() && t.follows.is_empty()) {
        let report = report(&name);
        assert_eq!(
            report.verdict,
            Verdict::Consistent,
            "{name}: {:?}",
            report.effects
        );
    }
}

/// What is in no catalogue is called unexplained, and the variable that it follows comes first.
#[test]
fn what_is_in_no_catalogue_is_described() {
    for (name, truth) in truths().into_iter().filter(|(_, t)| !t.follows.is_empty()) {
        let report = report(&name);
        assert!(report.effects.is_empty(), "{name}: {:?}", report.effects);
        assert_eq!(report.verdict, Verdict::Unexplained, "{name}");
        let first = &report.unattributed.depends_on[0].variable;
        assert!(truth.follows.contains(first), "{name} follows {first}");
    }
}

/// What is asked by name is told in sizes of its own: a sine and a cosine that share an amplitude are two
/// coefficients, each with a sigma, whatever its sign.
#[test]
fn every_size_has_a_name_and_a_sigma() {
    let (name, _) = truths().into_iter().next().unwrap();
    let bundle = Bundle::read(&worlds().join(&name)).unwrap();
    let model = Model::read(&worlds().join(&name).join("model.toml")).unwrap();
    let ids = ["pixel_phase_harmonics", "exposure_smear", "time_tag_offset"];
    let questions = Questions::about(ids).unwrap();
    let report = close_asking(&model, &bundle, &questions, &|_| ())
        .unwrap()
        .report;
    for asked in &report.hypotheses {
        let mut names = BTreeSet::new();
        for size in &asked.sizes {
            assert!(
                names.insert(&size.parameter),
                "{}: {} twice",
                asked.id,
                size.parameter
            );
            assert!(size.sigma.is_none_or(|s| s > 0.0), "{}: {size:?}", asked.id);
        }
    }
    assert_eq!(report.hypotheses.len(), ids.len());
}
