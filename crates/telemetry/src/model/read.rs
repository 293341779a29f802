//! Reading and checking a model file.
//!
//! Source: model format (docs/formats/model.md).

use std::collections::BTreeMap;

use super::{
    EffectEntry, EffectPlace, EffectValue, HemAxes, HemAxis, MODEL_FORMAT, Model, ModelKind,
    ModelNoise, ModelTracker,
};
use crate::TelemetryError;
use crate::config::{Config, Entry, Section};
use crate::metadata::read::{format, optics};

const TOP: &[&str] = &[
    "format", "kind", "title", "tracker", "noise", "hem", "effect",
];
const TRACKER: &[&str] = &[
    "pixels",
    "focal_length_px",
    "fov_deg",
    "pixel_centre",
    "update_rate_hz",
    "max_stars",
    "exposure_s",
];
const NOISE: &[&str] = &[
    "temporal_arcsec",
    "centroid_arcsec",
    "distortion_arcsec",
    "distortion_order",
    "bias_arcsec",
];
const AXIS: &[&str] = &["sigma_hsf_arcsec", "tau_hsf_s", "sigma_tn_arcsec"];

/// Tables that only a scenario has.
const SCENARIO: &[&str] = &["motion", "sky", "run", "reference", "rates", "housekeeping"];

/// Where a key that stands in the wrong table belongs.
const PLACES: &[(&str, &[&str])] = &[
    ("[tracker]", TRACKER),
    ("[noise]", NOISE),
    ("[hem.x], [hem.y] or [hem.z]", AXIS),
    ("the top of the file, above the first [table]", TOP),
];

/// Highest order of a distortion polynomial.
const HIGHEST_ORDER: i64 = 15;

pub(super) fn read(config: &Config, file: &str, ignored: &[&str]) -> Result<Model, TelemetryError> {
    let top = config.root();
    if ignored.is_empty() {
        refuse_scenario(&top)?;
    }
    top.allow_or_point(&[TOP, ignored].concat(), PLACES)?;
    format(&top, MODEL_FORMAT)?;
    let kind = match top.entry("kind") {
        Some(entry) => entry.choice(&[("pbm", ModelKind::Pbm), ("hem", ModelKind::Hem)])?,
        None => ModelKind::Pbm,
    };
    let model = Model {
        kind,
        title: top.text("title")?,
        tracker: top
            .section("tracker")?
            .map_or_else(|| Ok(ModelTracker::default()), |s| tracker(&s))?,
        noise: top
            .section("noise")?
            .map_or_else(|| Ok(ModelNoise::default()), |s| noise(&s))?,
        hem: top.section("hem")?.map(|s| hem(&s)).transpose()?,
        effects: top
            .sections("effect")?
            .iter()
            .map(effect)
            .collect::<Result<_, _>>()?,
        file: file.into(),
    };
    if kind == ModelKind::Hem && model.hem.is_none() {
        let message = "`kind`: \"hem\" expects [hem.x], [hem.y] and [hem.z], found none";
        return Err(config.error_at("kind", message));
    }
    Ok(model)
}

/// A scenario where a model is wanted is told as one, not as a misspelt key.
fn refuse_scenario(top: &Section<'_>) -> Result<(), TelemetryError> {
    let found: Vec<_> = SCENARIO.iter().filter_map(|key| top.entry(key)).collect();
    let Some(first) = found.iter().min_by_key(|entry| entry.line()) else {
        return Ok(());
    };
    let names: Vec<String> = found.iter().map(|e| format!("[{}]", e.key())).collect();
    Err(first.error_at_key(format!(
        "this is a scenario, expected a model, which has no {}: take these tables out, and the effects that are not to be declared",
        names.join(", ")
    )))
}

fn tracker(section: &Section<'_>) -> Result<ModelTracker, TelemetryError> {
    section.allow_or_point(TRACKER, PLACES)?;
    let optics = optics(section)?;
    Ok(ModelTracker {
        pixels: optics.pixels,
        focal_length_px: optics.focal_length_px,
        fov_deg: optics.fov_deg,
        pixel_centre: optics.pixel_centre,
        update_rate_hz: section.positive("update_rate_hz")?,
        max_stars: section.entry("max_stars").map(|e| e.count(1)).transpose()?,
        exposure_s: section.non_negative("exposure_s")?,
    })
}

fn noise(section: &Section<'_>) -> Result<ModelNoise, TelemetryError> {
    section.allow_or_point(NOISE, PLACES)?;
    let distortion_arcsec = section.non_negative("distortion_arcsec")?;
    let order = section.entry("distortion_order");
    let distortion_order = match &order {
        Some(entry) => {
            let order = entry.integer(0..=HIGHEST_ORDER)?;
            u32::try_from(order).ok()
        }
        None => None,
    };
    if let (Some(entry), Some(0), Some(size)) = (order, distortion_order, distortion_arcsec)
        && size > 0.0
    {
        return Err(entry.expected("an order above 0 (a constant cannot be scaled to an rms)"));
    }
    let bias_arcsec = section.numbers::<3>("bias_arcsec")?;
    if let (Some(bias), Some(entry)) = (bias_arcsec, section.entry("bias_arcsec"))
        && bias.iter().any(|&sigma| sigma < 0.0)
    {
        return Err(entry.expected("three 1-sigma sizes, none below 0"));
    }
    Ok(ModelNoise {
        temporal_arcsec: section.non_negative("temporal_arcsec")?,
        centroid_arcsec: section.non_negative("centroid_arcsec")?,
        distortion_arcsec,
        distortion_order,
        bias_arcsec,
    })
}

fn hem(section: &Section<'_>) -> Result<HemAxes, TelemetryError> {
    section.allow_or_point(&["x", "y", "z"], PLACES)?;
    let axis = |name: &str| -> Result<HemAxis, TelemetryError> {
        let section = section.require(name)?.table()?;
        section.allow_or_point(AXIS, PLACES)?;
        Ok(HemAxis {
            sigma_hsf_arcsec: section.require("sigma_hsf_arcsec")?.non_negative()?,
            tau_hsf_s: section.require("tau_hsf_s")?.positive()?,
            sigma_tn_arcsec: section.require("sigma_tn_arcsec")?.non_negative()?,
        })
    };
    Ok(HemAxes {
        x: axis("x")?,
        y: axis("y")?,
        z: axis("z")?,
    })
}

fn effect(section: &Section<'_>) -> Result<EffectEntry, TelemetryError> {
    let mut entry = EffectEntry {
        id: section.require("id")?.text()?.into(),
        parameters: BTreeMap::new(),
        at: EffectPlace::default(),
    };
    entry.at.head = Some(section.spot());
    for item in section.entries() {
        entry.at.keys.insert(item.key().into(), item.spot());
        if item.key() != "id" {
            entry.parameters.insert(item.key().into(), value(&item)?);
        }
    }
    Ok(entry)
}

fn value(entry: &Entry<'_>) -> Result<EffectValue, TelemetryError> {
    if entry.is_text() {
        return Ok(EffectValue::Text(entry.text()?.into()));
    }
    if entry.is_array() {
        let numbers: Result<Vec<f64>, _> = entry.items()?.iter().map(Entry::number).collect();
        return Ok(EffectValue::Numbers(numbers?));
    }
    match entry.number() {
        Ok(number) => Ok(EffectValue::Number(number)),
        Err(_) => Err(entry.expected("a finite number, a text, or an array of numbers")),
    }
}
