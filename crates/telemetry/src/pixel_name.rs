//! Names of the pixel columns of table `images`: `p<row><column>`, or `p<row>_<column>` beyond ten.
//!
//! Source: telemetry bundle format, table `images` (docs/formats/bundle.md).

use serde::{Serialize, Serializer};

/// Name of the pixel at `[row, column]`.
pub(crate) fn of(pixel: [usize; 2]) -> String {
    let [row, column] = pixel;
    if row < 10 && column < 10 {
        format!("p{row}{column}")
    } else {
        format!("p{row}_{column}")
    }
}

/// Row and column that a name means; `None` if it is no pixel's name.
pub(crate) fn parse(name: &str) -> Option<[usize; 2]> {
    let digits = name.strip_prefix('p')?;
    let (row, column) = match digits.split_once('_') {
        Some(pair) => pair,
        None if digits.len() == 2 && digits.is_ascii() => digits.split_at(1),
        None => return None,
    };
    let number = |text: &str| {
        let plain = !text.is_empty() && text.len() <= 4 && text.bytes().all(|b| b.is_ascii_digit());
        plain.then(|| text.parse().ok()).flatten()
    };
    Some([number(row)?, number(column)?])
}

pub(crate) fn serialize_all<S: Serializer>(
    pixels: &[[usize; 2]],
    to: S,
) -> Result<S::Ok, S::Error> {
    let names: Vec<String> = pixels.iter().map(|&pixel| of(pixel)).collect();
    names.serialize(to)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_round_and_nothing_else_is_a_pixel() {
        for pixel in [[0, 0], [9, 9], [3, 11], [12, 0], [10, 10]] {
            assert_eq!(parse(&of(pixel)), Some(pixel));
        }
        assert_eq!(parse("p3_4"), Some([3, 4]));
        for name in [
            "p", "p1", "p123", "pressure", "p_1", "p1_", "p-1_2", "q00", "p1_x",
        ] {
            assert_eq!(parse(name), None, "{name}");
        }
    }
}
