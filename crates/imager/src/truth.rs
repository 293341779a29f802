//! What acts in a world, for whoever judges a diagnosis: `[truth]`, and the sealed file beside a bundle.
//!
//! Nothing here acts on a pixel.
//!
//! Not physics: reading and writing a file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::{ImagerError, Instrument, Run, Summary};

/// `[truth]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Truth {
    /// The analyst's model: a file, relative to that of the world.
    pub model: Option<String>,
    /// What acts and is in the catalogue of effects.
    pub effect: Vec<Acting>,
    /// What acts and is in no catalogue, in words.
    pub outside: Vec<String>,
    /// What the leftover follows, in the words of a report, where something is outside: any of them.
    pub follows: Vec<String>,
    /// Anything else worth knowing.
    pub note: Option<String>,
}

/// `[[truth.effect]]`
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Acting {
    /// Id in the catalogue of effects.
    pub id: String,
    /// Ids that would be as right.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub or: Vec<String>,
    /// What is no number: a channel, a star.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub selectors: BTreeMap<String, String>,
    /// Parameters that follow from the settings.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<String, f64>,
}

impl Truth {
    pub(crate) fn check(&self) -> Result<(), ImagerError> {
        for acting in &self.effect {
            for value in acting.values.values() {
                ImagerError::finite("truth.effect.values", *value)?;
            }
        }
        Ok(())
    }

    /// The sealed file: what acts, every setting, and what the run was.
    pub(crate) fn sealed(&self, instrument: &Instrument, run: &Run, summary: Summary) -> String {
        let mut settings = json!(instrument);
        if let Some(tables) = settings.as_object_mut() {
            tables.remove("truth");
        }
        let sealed = json!({
            "format": "boresight-truth/1",
            "title": run.title,
            "seed": run.seed,
            "draw": run.draw,
            "model": self.model,
            "effects": self.effect,
            "outside": self.outside,
            "follows": self.follows,
            "note": self.note,
            "summary": summary,
            "settings": settings,
        });
        format!("{sealed:#}")
    }
}
