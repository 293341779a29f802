//! Periodic misalignment: one line in the attitude, of any cause.
//!
//! ```text
//! theta_a(t) = a_cos cos(2 pi f (t - from)) + a_sin sin(2 pi f (t - from)),    a = x, y, z      arcsec, tracker axes
//! ```
//!
//! The phase counts from `from_s`, which is 0 where it is not given. A frequency that is known to `s_f` turns the
//! phase by 2 pi `s_f` (t - from), so that amplitudes far from the data are those of no line: where t = 0 lies more
//! than the data's own span from their middle, a line is found with the middle as `from_s`.
//!
//! A heater that cycles without a channel bends the frame at its fundamental (`thermal_misalignment` with a
//! `period_s`): the same but for harmonics, of which a frame much slower than its heater leaves 1/9, 1/25, ... So a
//! line as slow as heaters are has that for a twin, alike by sqrt(96 / pi^4) = 0.993, the fundamental's share of a triangle.
//!
//! Source: definition; harmonics of the orbit, for instance.

use core::f64::consts::{PI, TAU};

use crate::bending::{Bending, BendingCandidate, Bent};
use crate::candidate::DIFFERENCE;
use crate::parameters::Reader;
use crate::{
    ActsOn, Candidate, Coefficient, Effect, EffectError, EffectKind, Nonlinear, Parameter,
    Parameters, Scene, Surroundings, Twin,
};

const ID: &str = "periodic_misalignment";

const NAMES: [&str; 6] = [
    "x_cos_arcsec",
    "x_sin_arcsec",
    "y_cos_arcsec",
    "y_sin_arcsec",
    "z_cos_arcsec",
    "z_sin_arcsec",
];

/// A line goes round at least twice in the data: what does not is a drift.
const FEWEST_CYCLES: u32 = 2;
/// Heaters that cycle faster are none, s.
const FASTEST_HEATER_S: f64 = 30.0;
/// Frequencies that the catalogue proposes: the first harmonics of the span. A line above them, or
/// between them, is found in a spectrum, and [`line_at`] makes its candidate.
const HARMONICS: u32 = 24;
/// Up to here those half-way between two as well, where a harmonic would see four tenths of a line's power: a
/// spectrum has too little around so slow a line to hold it against.
const HALVED: u32 = 8;

/// The kind.
#[derive(Debug)]
pub(crate) struct Kind;

impl EffectKind for Kind {
    fn id(&self) -> &'static str {
        ID
    }
    fn summary(&self) -> &'static str {
        "the tracker swings against the reference at frequency_hz"
    }
    fn needs(&self) -> &'static str {
        "a reference, and more than one cycle of the line"
    }
    fn acts_on(&self) -> ActsOn {
        ActsOn {
            attitude: true,
            ..ActsOn::default()
        }
    }
    fn build(
        &self,
        parameters: &Parameters,
        _: &Surroundings<'_>,
    ) -> Result<Box<dyn Effect>, EffectError> {
        let mut known = vec!["frequency_hz", "from_s"];
        known.extend(NAMES);
        let reader = Reader::new(ID, parameters, &known)?;
        let frequency_hz = reader.within("frequency_hz", [1e-12, 1e6], "positive")?;
        let values = reader.axes(NAMES)?;
        let bending = Line {
            frequency_hz,
            from_s: reader.number("from_s")?.unwrap_or(0.0),
            range: [frequency_hz; 2],
            step: 0.0,
            picked_from: 1,
        };
        Ok(Box::new(Bent {
            bending,
            values: values.to_vec(),
        }))
    }
    fn candidates(&self, scene: &Scene<'_>) -> Vec<Box<dyn Candidate>> {
        let (span_s, span) = (scene.surroundings.span_s, scene.surroundings.length_s());
        if !scene.sees_misalignment() || span <= 0.0 {
            return Vec::new();
        }
        (2 * FEWEST_CYCLES..=2 * HARMONICS)
            .filter(|half| half % 2 == 0 || *half < 2 * HALVED)
            .map(|half| 0.5 * f64::from(half) / span)
            .take_while(|f| *f < 0.5 / scene.step_s)
            .map(|f| line_at(f, span_s, 1))
            .collect()
    }
}

/// A line of unknown amplitude at `frequency_hz`, in data from `span_s[0]` to `span_s[1]`, picked from
/// so many frequencies by looking at the data.
///
/// Frequency is refined within a bin `1 / span_s` to either side: what a line leaves at a slightly
/// wrong frequency would pass for another line.
pub fn line_at(frequency_hz: f64, span_s: [f64; 2], picked_from: usize) -> Box<dyn Candidate> {
    let (span, middle) = (span_s[1] - span_s[0], 0.5 * (span_s[0] + span_s[1]));
    let bin = 1.0 / span;
    let range = [(frequency_hz - bin).max(1.5 * bin), frequency_hz + bin];
    BendingCandidate::boxed(Line {
        frequency_hz,
        from_s: if middle.abs() > span { middle } else { 0.0 },
        range,
        step: 0.5 * bin,
        picked_from,
    })
}

#[derive(Clone, Debug)]
struct Line {
    frequency_hz: f64,
    from_s: f64,
    range: [f64; 2],
    step: f64,
    picked_from: usize,
}

impl Bending for Line {
    fn id(&self) -> &'static str {
        ID
    }
    fn coefficients(&self) -> Vec<Coefficient> {
        NAMES
            .map(|name| Coefficient::new(name, "arcsec", 5.0).as_misalignment())
            .into()
    }
    fn functions(&self) -> usize {
        2
    }
    fn at(&self, t_s: f64, out: &mut [f64]) {
        let turns = self.frequency_hz * (t_s - self.from_s);
        let (sin, cos) = (TAU * turns.fract()).sin_cos();
        out.copy_from_slice(&[cos, sin]);
    }
    fn fixed(&self) -> Vec<Parameter> {
        let mut all = vec![Parameter::new("frequency_hz", self.frequency_hz, "Hz")];
        if self.from_s != 0.0 {
            all.push(Parameter::new("from_s", self.from_s, "s"));
        }
        all
    }
    fn nonlinear(&self) -> Vec<Nonlinear> {
        vec![Nonlinear {
            name: "frequency_hz",
            unit: "Hz",
            value: self.frequency_hz,
            range: self.range,
            step: self.step,
            difference: Some(DIFFERENCE * self.step),
        }]
    }
    fn stands_for(&self) -> f64 {
        self.picked_from as f64
    }
    fn twin(&self) -> Option<Twin> {
        let period_s = self.frequency_hz.recip();
        let selectors = [("period_s".to_owned(), format!("{period_s:.0}"))];
        (period_s >= FASTEST_HEATER_S).then(|| Twin {
            id: "thermal_misalignment",
            selectors: selectors.into(),
            correlation: (96.0 / PI.powi(4)).sqrt(),
        })
    }
    fn with_nonlinear(&self, values: &[f64]) -> Option<Self> {
        let [low, high] = self.range;
        (low..=high).contains(&values[0]).then(|| Self {
            frequency_hz: values[0],
            ..self.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::Bench;

    /// Of a line a frequency d bins off shows sinc^2(d) of the power: 0.81 at a quarter of a bin. Among harmonics
    /// alone a line half-way between two shows 0.41, and one of eight sigma is missed.
    #[test]
    fn a_slow_line_keeps_four_fifths_of_its_power() {
        let bench = Bench::new();
        let scene = bench.scene(None);
        let bin = 1.0 / scene.surroundings.length_s();
        let proposed: Vec<f64> = Kind
            .candidates(&scene)
            .iter()
            .map(|c| c.nonlinear()[0].value)
            .collect();
        for k in 0..=600 {
            let f = (f64::from(FEWEST_CYCLES) + 0.01 * f64::from(k)) * bin;
            let off = proposed
                .iter()
                .map(|p| (p - f).abs() / bin)
                .fold(f64::INFINITY, f64::min);
            let turns = PI * off.max(1e-9);
            assert!((turns.sin() / turns).powi(2) > 0.8, "{f} Hz: {off} bins");
        }
    }

    /// A cycling heater's bending, made by its own effect, against the sinusoid of its period: as alike as its twin says.
    #[test]
    fn a_cycling_heater_is_a_twin() {
        let bench = Bench::new();
        let scene = bench.scene(None);
        let period_s = 183.0;
        let line = line_at(1.0 / period_s, [0.0, 3660.0], 1);
        let twin = line.twin().unwrap();
        assert_eq!(twin.selectors["period_s"], "183");
        let values = [("period_s", period_s), ("x_arcsec", 2.0)];
        let values = values.map(|(name, value)| (name.to_owned(), value.into()));
        let heater = crate::build(twin.id, &values.into(), &scene.surroundings).unwrap();
        let (mut cos, mut sin, mut power) = (0.0, 0.0, 0.0);
        let n = 3660;
        for k in 0..n {
            let t = f64::from(k);
            let x = heater.misalignment_rad(t).x;
            let (s, c) = (TAU * t / period_s).sin_cos();
            cos += x * c;
            sin += x * s;
            power += x * x;
        }
        let alike = ((cos * cos + sin * sin) / (0.5 * f64::from(n) * power)).sqrt();
        assert!((alike - twin.correlation).abs() < 2e-3, "{alike}");
        // heaters do not cycle within seconds
        assert_eq!(line_at(0.5, [0.0, 3660.0], 1).twin(), None);
    }
}
