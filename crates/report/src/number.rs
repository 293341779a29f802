//! Numbers as people read them.

use closed_loop::NEXT_TO_NEVER;

/// Four significant digits, plain where that is readable.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (1e-3..1e6).contains(&size) {
        let digits = if size >= 1000.0 {
            0
        } else if size >= 1.0 {
            3
        } else {
            5
        };
        let text = format!("{value:.digits$}");
        return if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        };
    }
    format!("{value:.3e}")
}

/// One decimal, as [`decimal`] has it; nothing has no sign.
pub(crate) fn tenths(value: f64) -> String {
    let text = decimal(value, 1);
    if text == "-0.0" {
        "0.0".to_owned()
    } else {
        text
    }
}

/// Three significant digits, with typographic signs.
pub(crate) fn short(value: f64) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    let size = value.abs();
    if value != 0.0 && !(1e-3..1e5).contains(&size) {
        return scientific(value, 2);
    }
    let digits = decimals(if size > 0.0 {
        2.0 - size.log10().floor()
    } else {
        0.0
    });
    format!("{value:.digits$}").replace('-', "−")
}

/// A value with as many digits as its sigma allows: two of the sigma.
pub(crate) fn with_sigma(value: f64, sigma: f64) -> String {
    if !(value.is_finite() && sigma.is_finite() && sigma > 0.0) {
        return short(value);
    }
    let size = value.abs().max(sigma);
    let exponent = if (1e-2..1e5).contains(&size) {
        0.0
    } else {
        size.log10().floor()
    };
    let scale = 10_f64.powf(exponent);
    let digits = decimals(1.0 - (sigma / scale).log10().floor());
    let both = format!("{:.digits$} ± {:.digits$}", value / scale, sigma / scale).replace('-', "−");
    if exponent == 0.0 {
        both
    } else {
        format!("({both}) × 10{}", raised(exponent))
    }
}

/// A share in percent, without its sign.
pub(crate) fn percent(share: f64) -> String {
    let value = 100.0 * share;
    if !value.is_finite() {
        return "–".to_owned();
    }
    let digits = usize::from(value.abs() < 99.95) + usize::from(value.abs() < 9.995);
    let text = format!("{value:.digits$}");
    // nothing is not less than nothing
    let text = if text == "-0.00" { "0.00" } else { &text };
    text.replace('-', "−")
}

/// A number with so many `decimals`, as a power of ten where that is longer than a table's column can be, and a dash
/// where there is none.
pub(crate) fn decimal(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        "-".to_owned()
    } else if value.abs() < 1e10 {
        format!("{value:.decimals$}")
    } else {
        format!("{value:.3e}")
    }
}

/// As [`number`]; a large one that this rounds by more than it is `known_to`, with two digits of that.
pub(crate) fn number_to(value: f64, known_to: f64) -> String {
    let told = number(value);
    let rounded = told.parse::<f64>().map_or(0.0, |told| (told - value).abs());
    if value.abs() >= 1.0 && known_to > 0.0 && rounded > known_to {
        known_digits(value, known_to)
    } else {
        told
    }
}

/// As [`short`]; one with a power of ten that is `known_to` better than a unit of its last digit, with two digits of that.
pub(crate) fn short_to(value: f64, known_to: f64) -> String {
    if (1e5..f64::INFINITY).contains(&value.abs())
        && known_to > 0.0
        && known_to < 10_f64.powf(value.abs().log10().floor() - 2.0)
    {
        known_digits(value, known_to).replace('-', "−")
    } else {
        short(value)
    }
}

fn known_digits(value: f64, known_to: f64) -> String {
    let digits = decimals(1.0 - known_to.log10().floor());
    format!("{value:.digits$}")
}

/// A change with its sign, one decimal; nothing has no sign.
pub(crate) fn change(value: f64) -> String {
    let text = format!("{value:+.1}");
    match text.as_str() {
        "+0.0" | "-0.0" => "0.0".to_owned(),
        text => text.replace('-', "−"),
    }
}

/// A probability.
pub(crate) fn probability(p: f64) -> String {
    if p.is_nan() {
        "–".to_owned()
    } else if p < NEXT_TO_NEVER {
        "< 10⁻³⁰⁰".to_owned()
    } else if p < 1e-3 {
        scientific(p, 1)
    } else {
        format!("{p:.3}")
    }
}

/// The same within a sentence.
pub(crate) fn p_is(p: f64) -> String {
    let told = probability(p);
    let sign = if told.starts_with('<') { "" } else { "= " };
    format!("p {sign}{told}")
}

/// A frequency with its unit.
pub(crate) fn hertz(f: f64) -> String {
    if f < 1e-4 {
        format!("{} µHz", short(1e6 * f))
    } else if f < 0.1 {
        format!("{} mHz", short(1e3 * f))
    } else {
        format!("{} Hz", short(f))
    }
}

fn scientific(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let exponent = exponent.parse().unwrap_or(0.0);
    format!("{} × 10{}", mantissa.replace('-', "−"), raised(exponent))
}

fn raised(exponent: f64) -> String {
    format!("{exponent:.0}")
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            c => c
                .to_digit(10)
                .and_then(|d| char::from_u32(0x2070 + d))
                .unwrap_or(c),
        })
        .collect()
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "0 to 9"
)]
fn decimals(digits: f64) -> usize {
    digits.clamp(0.0, 9.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_readable() {
        assert_eq!(number(3.01e-5), "3.010e-5");
        assert_eq!(number(0.9), "0.9");
        assert_eq!(number(408.0), "408");
        assert_eq!(number(12345.6), "12346");
        assert_eq!(number(0.0), "0");
    }

    #[test]
    fn a_number_has_as_many_digits_as_are_known() {
        assert_eq!(number_to(1.0e9 + 1.53, 0.5), "1000000001.53");
        assert_eq!(number_to(1.0e9 + 1.53, 30.0), "1.000e9");
        assert_eq!(number_to(1_234_567.0, 30.0), "1234567");
        assert_eq!(number_to(0.0301, 1.9e-4), "0.0301");
        assert_eq!(number_to(5.0612, 2e-3), "5.061");
        assert_eq!(number_to(812.5, 12.0), "812.5");
        assert_eq!(short_to(-1.0e9 - 1.53, 0.5), "−1000000001.53");
        assert_eq!(short_to(1.0e9 + 1.53, 2e7), "1.00 × 10⁹");
        assert_eq!(short_to(812.5, 1.0), "812");
    }

    #[test]
    fn columns_hold_what_is_no_usual_number() {
        assert_eq!(decimal(-1.352e272, 4), "-1.352e272");
        assert_eq!(decimal(-12.74221, 4), "-12.7422");
        let none = [f64::NAN, f64::INFINITY].map(|v| decimal(v, 1));
        assert_eq!(none, ["-", "-"]);
    }

    #[test]
    fn three_digits_are_enough_for_a_reader() {
        assert_eq!(short(0.2733), "0.273");
        assert_eq!(short(-12.345), "−12.3");
        assert_eq!(short(12099.0), "12099");
        assert_eq!(short(4.2e-7), "4.20 × 10⁻⁷");
        assert_eq!(short(0.0), "0");
        assert_eq!(short(f64::NAN), "–");
    }

    #[test]
    fn a_sigma_tells_how_many_digits_count() {
        assert_eq!(with_sigma(0.8706, 0.02052), "0.871 ± 0.021");
        assert_eq!(with_sigma(3.0203e-5, 1.103e-6), "(3.02 ± 0.11) × 10⁻⁵");
        assert_eq!(with_sigma(-54.857, 1.92), "−54.9 ± 1.9");
        assert_eq!(with_sigma(123_456.0, 2000.0), "(1.235 ± 0.020) × 10⁵");
        assert_eq!(with_sigma(0.0, 0.05), "0.000 ± 0.050");
    }

    #[test]
    fn probabilities_and_frequencies_have_their_powers() {
        assert_eq!(probability(2.4e-33), "2.4 × 10⁻³³");
        assert_eq!(probability(0.0), "< 10⁻³⁰⁰");
        assert_eq!(probability(0.26), "0.260");
        assert_eq!([p_is(0.0), p_is(0.26)], ["p < 10⁻³⁰⁰", "p = 0.260"]);
        let plain = [0.0, 1.4e-5].map(closed_loop::p_is);
        assert_eq!(plain, ["p < 1e-300", "p = 1.4e-5"]);
        assert_eq!(percent(0.243), "24.3");
        assert_eq!(percent(8.02e-5), "0.01");
        assert_eq!(percent(-1e-6), "0.00");
        assert_eq!(percent(1.0), "100");
        assert_eq!(
            [change(-0.04), change(0.06), change(-3.0)],
            ["0.0", "+0.1", "−3.0"]
        );
        assert_eq!(hertz(2.1e-5), "21.0 µHz");
        assert_eq!(hertz(0.05), "50.0 mHz");
        assert_eq!(hertz(1.5), "1.50 Hz");
    }
}
