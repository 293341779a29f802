//! Axes: range, scale, and where the ticks are.
//!
//! ```text
//! linear       steps of 1, 2 or 5 times a power of ten, some six of them
//! logarithmic  decades, with 2 and 5 where there are fewer than two of them; light lines at 2 to 9;
//!              the steps of a linear axis where even of these there would be fewer than three
//! ```
//!
//! Not physics: drawing.

/// An axis with its label, unit in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    pub(crate) label: String,
    pub(crate) log: bool,
    pub(crate) range: Option<[f64; 2]>,
}

impl Axis {
    /// A linear axis as long as its data.
    #[must_use]
    pub fn linear(label: &str) -> Self {
        Self {
            label: label.to_owned(),
            log: false,
            range: None,
        }
    }

    /// A logarithmic axis as long as its data; values of zero and less are not drawn.
    #[must_use]
    pub fn log(label: &str) -> Self {
        Self {
            log: true,
            ..Self::linear(label)
        }
    }

    /// The same from `from` to `to`.
    #[must_use]
    pub fn over(self, from: f64, to: f64) -> Self {
        Self {
            range: Some([from, to]),
            ..self
        }
    }
}

/// An axis laid over pixels.
#[derive(Clone, Debug)]
pub(crate) struct Laid {
    log: bool,
    /// Ends on the axis' own scale (logarithms where it is one).
    ends: [f64; 2],
    px: [f64; 2],
}

/// A tick: place in px, and its text if it has one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) px: f64,
    pub(crate) text: Option<String>,
}

impl Laid {
    /// `data` are the smallest and largest value to be shown.
    pub(crate) fn new(axis: &Axis, data: Option<[f64; 2]>, px: [f64; 2]) -> Self {
        let fallback = if axis.log { [0.1, 10.0] } else { [0.0, 1.0] };
        let shown = axis.range.or(data).unwrap_or(fallback);
        let mut ends = shown.map(|v| if axis.log { v.log10() } else { v });
        if !ends.iter().all(|e| e.is_finite()) {
            ends = fallback.map(|v| if axis.log { v.log10() } else { v });
        }
        let width = ends[1] - ends[0];
        if width <= 1e-12 * ends[0].abs().max(1e-300) {
            let half = if axis.log {
                0.5
            } else {
                0.5 * ends[0].abs().max(1.0)
            };
            ends = [ends[0] - half, ends[0] + half];
        } else if axis.range.is_none() {
            let margin = if axis.log { 0.03 } else { 0.04 } * width;
            ends = [ends[0] - margin, ends[1] + margin];
        }
        Self {
            log: axis.log,
            ends,
            px,
        }
    }

    /// Where a value is, px; NaN where it cannot be shown.
    pub(crate) fn at(&self, value: f64) -> f64 {
        let value = match self.log {
            true if value > 0.0 => value.log10(),
            true => return f64::NAN,
            false => value,
        };
        let part = (value - self.ends[0]) / (self.ends[1] - self.ends[0]);
        self.px[0] + part * (self.px[1] - self.px[0])
    }

    /// Pixels to a unit of a linear axis.
    pub(crate) fn px_per_unit(&self) -> f64 {
        (self.px[1] - self.px[0]).abs() / (self.ends[1] - self.ends[0])
    }

    pub(crate) fn ends(&self) -> [f64; 2] {
        self.ends
    }

    /// The same with other ends.
    pub(crate) fn with_ends(self, ends: [f64; 2]) -> Self {
        Self { ends, ..self }
    }

    pub(crate) fn ticks(&self, about: f64) -> Vec<Tick> {
        if self.log {
            self.log_ticks(about)
        } else {
            self.linear_ticks(about)
        }
    }

    fn linear_ticks(&self, about: f64) -> Vec<Tick> {
        let [low, high] = self.ends;
        let step = nice((high - low) / about.max(1.0));
        let decimals = (-step.log10().floor()).max(0.0);
        let mut out = vec![];
        let mut k = (low / step).ceil();
        while k * step <= high + 1e-9 * step {
            let value = k * step;
            out.push(Tick {
                px: self.at(value),
                text: Some(written(value, decimals)),
            });
            k += 1.0;
        }
        out
    }

    /// Round numbers at equal steps on a logarithmic axis of a fraction of a decade.
    fn narrow_ticks(&self, about: f64) -> Vec<Tick> {
        let [low, high] = self.ends.map(|e| 10_f64.powf(e));
        let step = nice((high - low) / about.max(1.0));
        let decimals = (-step.log10().floor()).max(0.0);
        let mut out = vec![];
        let mut k = (low / step).ceil();
        while k * step <= high + 1e-9 * step {
            out.push(Tick {
                px: self.at(k * step),
                text: Some(written(k * step, decimals)),
            });
            k += 1.0;
        }
        out
    }

    fn log_ticks(&self, about: f64) -> Vec<Tick> {
        let ticks = self.decade_ticks(about);
        let labels = ticks.iter().filter(|tick| tick.text.is_some()).count();
        // a decade has 1, 2 and 5
        if labels < 3 && self.ends[1] - self.ends[0] < 1.0 {
            self.narrow_ticks(about)
        } else {
            ticks
        }
    }

    fn decade_ticks(&self, about: f64) -> Vec<Tick> {
        let [low, high] = self.ends;
        let decades = high - low;
        let every = (decades / about.max(1.0)).ceil().max(1.0);
        let few = decades < 1.7;
        let mut out = vec![];
        let mut exponent = low.floor();
        while exponent <= high {
            for digit in 1..10_u32 {
                let place = exponent + f64::from(digit).log10();
                if place < low - 1e-9 || place > high + 1e-9 {
                    continue;
                }
                let plain = few && (-3.5..4.5).contains(&exponent);
                let text = match digit {
                    1 | 2 | 5 if plain => {
                        let value = f64::from(digit) * 10_f64.powf(exponent);
                        Some(written(value, (-exponent).max(0.0)))
                    }
                    1 if (exponent / every).fract().abs() < 1e-9 => Some(power(exponent)),
                    2 | 5 if few => Some(format!("{digit}·{}", power(exponent))),
                    _ => None,
                };
                if digit == 1 || decades < 8.0 {
                    let part = (place - low) / (high - low);
                    out.push(Tick {
                        px: self.px[0] + part * (self.px[1] - self.px[0]),
                        text,
                    });
                }
            }
            exponent += 1.0;
        }
        out
    }
}

/// 1, 2 or 5 times a power of ten, at least `value`.
fn nice(value: f64) -> f64 {
    let value = if value.is_finite() && value > 0.0 {
        value
    } else {
        1.0
    };
    let power = 10_f64.powf(value.log10().floor());
    let digit = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|d| d * power >= value * (1.0 - 1e-9));
    digit.unwrap_or(10.0) * power
}

/// 1, 2 or 5 times a power of ten, at most `value`, which is positive.
pub(crate) fn nice_below(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    let digit = [5.0, 2.0].into_iter().find(|d| d * power <= value);
    digit.unwrap_or(1.0) * power
}

fn power(exponent: f64) -> String {
    if (-0.5..1.5).contains(&exponent) {
        return if exponent < 0.5 { "1" } else { "10" }.to_owned();
    }
    let digits = "⁰¹²³⁴⁵⁶⁷⁸⁹";
    let raised: String = format!("{:.0}", exponent.abs())
        .bytes()
        .filter_map(|b| digits.chars().nth(usize::from(b - b'0')))
        .collect();
    let sign = if exponent < 0.0 { "⁻" } else { "" };
    format!("10{sign}{raised}")
}

/// A number with as many decimals as its step has.
pub(crate) fn written(value: f64, decimals: f64) -> String {
    let value = if value == 0.0 { 0.0 } else { value };
    if value.abs() >= 1e6 || (value != 0.0 && decimals > 5.0) {
        return format!("{value:e}");
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to 5"
    )]
    let decimals = decimals.min(5.0) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(ticks: &[Tick]) -> Vec<String> {
        ticks.iter().filter_map(|t| t.text.clone()).collect()
    }

    #[test]
    fn linear_ticks_are_round_and_inside() {
        let laid = Laid::new(&Axis::linear("s").over(-3.0, 7.3), None, [0.0, 100.0]);
        let ticks = laid.ticks(6.0);
        assert_eq!(texts(&ticks), ["−2", "0", "2", "4", "6"]);
        assert!(ticks.iter().all(|t| (0.0..=100.0).contains(&t.px)));
    }

    #[test]
    fn decades_are_labelled_and_digits_where_there_are_few() {
        let wide = Laid::new(&Axis::log("Hz").over(1e-4, 10.0), None, [0.0, 100.0]);
        assert_eq!(
            texts(&wide.ticks(8.0)),
            ["10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "1", "10"]
        );
        let narrow = Laid::new(&Axis::log("Hz").over(0.03, 0.3), None, [0.0, 100.0]);
        assert_eq!(texts(&narrow.ticks(8.0)), ["0.05", "0.1", "0.2"]);
        let spans = Laid::new(&Axis::log("s").over(4.5, 170.0), None, [0.0, 100.0]);
        assert_eq!(texts(&spans.ticks(8.0)), ["5", "10", "20", "50", "100"]);
        let tiny = Laid::new(&Axis::log("Hz").over(1e-7, 1e-6), None, [0.0, 100.0]);
        assert_eq!(
            texts(&tiny.ticks(8.0)),
            ["10⁻⁷", "2·10⁻⁷", "5·10⁻⁷", "10⁻⁶"]
        );
    }

    /// From 22 to 36 there is neither 20 nor 50: an axis without numbers says nothing.
    #[test]
    fn a_fraction_of_a_decade_has_its_numbers() {
        let laid = Laid::new(&Axis::log("arcsec").over(22.0, 36.0), None, [0.0, 100.0]);
        let ticks = laid.ticks(5.0);
        assert_eq!(texts(&ticks), ["25", "30", "35"]);
        assert!(
            (ticks[1].px - 100.0 * (30.0_f64 / 22.0).log10() / (36.0_f64 / 22.0).log10()).abs()
                < 1e-9
        );
    }

    #[test]
    fn nothing_to_show_still_makes_an_axis() {
        for data in [None, Some([2.0, 2.0]), Some([f64::NAN, 1.0])] {
            for axis in [Axis::linear("x"), Axis::log("x")] {
                let laid = Laid::new(&axis, data, [0.0, 100.0]);
                let [low, high] = laid.ends();
                assert!(low.is_finite() && high > low, "{data:?} {laid:?}");
            }
        }
        let log = Laid::new(&Axis::log("x"), Some([1.0, 2.0]), [0.0, 100.0]);
        assert!(log.at(-1.0).is_nan());
    }
}
