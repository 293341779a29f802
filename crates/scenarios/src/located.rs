//! Errors with their place: which line of which file says what turned out to be wrong.
//!
//! Not physics: messages.

use effects::EffectError;
use telemetry::Model;
use telemetry::config::Config;

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
            Self::File(_) | Self::NoPreset { .. } => return self,
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
        Config::blame(text, file, path, value, self.to_string()).into()
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
    let located = model.effect_error_in_line(index, error.key(), &error.to_string());
    located.map_or_else(|| error.into(), Into::into)
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
