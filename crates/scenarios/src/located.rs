//! Errors with their place: which line of which file says what turned out to be wrong.
//!
//! Not physics: messages.

use effects::EffectError;
use telemetry::config::Config;
use telemetry::{EffectEntry, EffectValue, Model, TelemetryError};

use crate::ScenarioError;

impl ScenarioError {
    /// The same with the file, and the line where one is to blame; `text` is the scenario, `file` its
    /// name. What has a place already keeps it.
    ///
    /// ```
    /// use scenarios::{Scenario, simulate};
    /// let text = "format = \"boresight-model/1\"\n[motion]\nkind = \"hold\"\n[run]\nduration_s = -1.0\n";
    /// let error = simulate(&Scenario::parse(text, "a.toml")?).unwrap_err().in_file(text, "a.toml");
    /// assert!(error.to_string().starts_with("a.toml, line 5, column 14: run.duration_s = -1 must be"));
    /// # Ok::<(), scenarios::ScenarioError>(())
    /// ```
    #[must_use]
    pub fn in_file(self, text: &str, file: &str) -> Self {
        let (path, value) = match &self {
            Self::File(_) | Self::NoPreset { .. } | Self::InFile { .. } => return self,
            Self::OutOfRange { name, value, .. } => (key(name), Some(*value)),
            Self::Missing { name } => (key(name), None),
            Self::NoCentroids => ("run.tables", None),
            Self::RepeatedChannel { .. } => ("housekeeping.channel", None),
            Self::NoRecording { .. } => ("motion.bundle", None),
            Self::Fogm(_) => ("hem", None),
            Self::Camera(_) => ("tracker", None),
            Self::Distortion(_) => ("noise.distortion_arcsec", None),
            _ => ("", None),
        };
        let reason = self.to_string();
        match Config::parse(text, file) {
            Ok(config) if !path.is_empty() => config.error_at_value(path, value, reason).into(),
            _ => Self::InFile {
                file: file.to_owned(),
                reason,
            },
        }
    }
}

/// The dotted path in what a message calls a key: `run.rate_hz or tracker.update_rate_hz`.
fn key(name: &str) -> &str {
    let mut words = name
        .split(' ')
        .map(|word| word.trim_matches(['[', ']', ',']));
    words.find(|word| word.contains('.')).unwrap_or("")
}

/// An error of an `[[effect]]` of a model, shown in its line where the model came from a file.
#[must_use]
pub fn effect_error(model: &Model, index: usize, error: EffectError) -> ScenarioError {
    let key = parameter(&error);
    let entry = model.effects.get(index);
    // line 0: the model was made in memory
    if entry.is_none_or(|entry| entry.at.line(key) == 0) {
        return error.into();
    }
    model.effect_error(index, key, &error.to_string()).into()
}

/// An error of an effect of this model whose entry is not known, shown in the line that it is probably
/// about; none where no entry is.
///
/// ```
/// use effects::EffectError;
/// let text = "format = \"boresight-model/1\"\n[[effect]]\nid = \"outliers\"\n[[effect]]\nid = \"roling\"\n";
/// let model = telemetry::Model::parse(text, "a.toml", &[])?;
/// let error = effects::kind("roling").err().and_then(|e| scenarios::found_effect_error(&model, &e));
/// assert!(error.is_some_and(|e| e.to_string().starts_with("a.toml, line 5,")));
/// # Ok::<(), telemetry::TelemetryError>(())
/// ```
#[must_use]
pub fn found_effect_error(model: &Model, error: &EffectError) -> Option<TelemetryError> {
    let of_kind = |entry: &&EffectEntry| entry.id == id(error);
    let says = |entry: &&EffectEntry| of_kind(entry) && says(entry, error);
    let entries = &model.effects;
    let entry = entries.iter().find(says);
    let entry = entry.or_else(|| entries.iter().find(of_kind))?;
    let index = entries
        .iter()
        .position(|other| std::ptr::eq(other, entry))?;
    Some(model.effect_error(index, parameter(error), &error.to_string()))
}

/// Whether an entry holds what the error names.
fn says(entry: &EffectEntry, error: &EffectError) -> bool {
    let given = entry.parameters.get(parameter(error));
    match error {
        EffectError::OutOfRange { value, .. } => match given {
            Some(EffectValue::Number(number)) => number.total_cmp(value).is_eq(),
            _ => false,
        },
        EffectError::NoChannel { channel, .. } | EffectError::WrongChannel { channel, .. } => {
            let texts = entry.parameters.values().map(|value| match value {
                EffectValue::Text(text) => text.as_str(),
                _ => "",
            });
            texts
                .into_iter()
                .any(|text| text.ends_with(channel.as_str()))
        }
        EffectError::MissingParameter { name, .. } => !entry.parameters.contains_key(*name),
        _ => given.is_some(),
    }
}

/// The effect that an error is about.
fn id(error: &EffectError) -> &str {
    match error {
        EffectError::UnknownEffect { id, .. } => id,
        EffectError::UnknownParameter { effect, .. }
        | EffectError::MissingParameter { effect, .. }
        | EffectError::Conflicting { effect, .. }
        | EffectError::WrongType { effect, .. }
        | EffectError::OutOfRange { effect, .. }
        | EffectError::NoChannel { effect, .. }
        | EffectError::WrongChannel { effect, .. }
        | EffectError::NoFrames { effect, .. }
        | EffectError::ActsOnImages { effect } => effect,
        _ => "",
    }
}

/// The key whose value is to blame; the whole entry where none is.
fn parameter(error: &EffectError) -> &str {
    match error {
        EffectError::UnknownEffect { .. } | EffectError::ActsOnImages { .. } => "id",
        EffectError::UnknownParameter { name, .. }
        | EffectError::Conflicting { name, .. }
        | EffectError::WrongType { name, .. }
        | EffectError::OutOfRange { name, .. } => name,
        EffectError::NoChannel { .. } | EffectError::WrongChannel { .. } => "channel",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use crate::{Scenario, simulate};

    const SLEWS: &str = r#"format = "boresight-model/1"
[tracker]
pixels = [512, 512]
fov_deg = [20.0, 20.0]
[[effect]]
id = "rolling_shutter"
line_time_s = 30e-6
[[effect]]
id = "step_misalignment"
x_arcsec = 1.0
at_s = 3.0
[motion]
kind = "slews"
[[motion.slew]]
axis = [1.0, 0.0, 0.0]
angle_deg = 1.0
duration_s = 5.0
[[motion.slew]]
axis = [0.0, 0.0, 1.0]
angle_deg = 1.0
duration_s = 5.0
[run]
duration_s = 10.0
rate_hz = 2.0
"#;

    fn message(from: &str, to: &str) -> String {
        assert!(SLEWS.contains(from), "{from} is in the file");
        let text = SLEWS.replacen(from, to, 1);
        let scenario = Scenario::parse(&text, "s.toml").unwrap();
        let error = simulate(&scenario).unwrap_err();
        error.in_file(&text, "s.toml").to_string()
    }

    #[test]
    fn a_value_out_of_range_is_shown_in_its_line() {
        for (from, to, line) in [
            ("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 0.0, 0.0]", 19),
            ("duration_s = 10.0", "duration_s = -1.0", 23),
            ("rate_hz = 2.0", "rate_hz = 0.0", 24),
            ("pixels = [512, 512]\n", "", 2),
        ] {
            let said = message(from, to);
            assert!(
                said.starts_with(&format!("s.toml, line {line}, ")),
                "{said}"
            );
        }
    }

    #[test]
    fn a_mistake_in_an_effect_is_shown_in_its_line() {
        for (from, to, line) in [
            ("rolling_shutter", "roling_shutter", 6),
            ("line_time_s", "line_tim_s", 7),
            ("30e-6", "\"fast\"", 7),
            ("at_s = 3.0\n", "", 8),
        ] {
            let said = message(from, to);
            assert!(
                said.starts_with(&format!("s.toml, line {line}, ")),
                "{said}"
            );
        }
    }
}
