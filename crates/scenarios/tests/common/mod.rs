//! Scenarios that the tests share.

use scenarios::{Scenario, ScenarioError};

/// A scenario with the given `[noise]` entries, effects and other tables.
pub(crate) fn scenario(noise: &str, rest: &str) -> Result<Scenario, ScenarioError> {
    let text = format!(
        "format = \"boresight-model/1\"\nkind = \"pbm\"\n\
         [tracker]\npixels = [1024, 1024]\nfov_deg = [20.0, 20.0]\nmax_stars = 14\n\
         [noise]\n{noise}\n{rest}\n"
    );
    Scenario::parse(&text, "test.toml")
}

/// Two slews to and fro about each cross axis.
pub(crate) const SLEWS: &str = "
[motion]
kind = \"slews\"
start = { ra_deg = 75.0, dec_deg = 12.0, roll_deg = 20.0 }
drift_arcsec_s = [11.0, -17.0, 0.5]
slew = [
  { axis = [1.0, 0.0, 0.0], angle_deg = 2.0, duration_s = 30.0, hold_s = 5.0 },
  { axis = [0.0, 1.0, 0.0], angle_deg = 2.0, duration_s = 30.0, hold_s = 5.0 },
  { axis = [1.0, 0.0, 0.0], angle_deg = -2.0, duration_s = 30.0, hold_s = 5.0 },
  { axis = [0.0, 1.0, 0.0], angle_deg = -2.0, duration_s = 30.0, hold_s = 5.0 },
]
";
