//! What became of the raw windows, in words.
//!
//! Not physics: sentences.

use telemetry::report::Windows;

/// A sentence for each thing that is not as it should be: nothing where every star row has a window and every window
/// was used.
pub(crate) fn sentences(windows: Option<&Windows>) -> Vec<String> {
    let Some(w) = windows else {
        return Vec::new();
    };
    let mut out = Vec::new();
    if let Some(why) = &w.not_formed {
        let all = w.used + w.unused;
        out.push(format!("raw windows: none of {all} can be used: {why}"));
    }
    if w.unused > 0 && w.used > 0 {
        out.push(format!(
            "raw windows: {} of {} are of no star row, by time and slot, or hold too little to be used",
            w.unused,
            w.used + w.unused
        ));
    }
    if w.rows_left_out > 0 {
        out.push(format!(
            "raw windows: {} star rows are left out of search and figures, because nothing can be formed anew from a window of theirs, as it is for the others; without the table images every row would count",
            w.rows_left_out
        ));
    } else if w.rows_without > 0 && w.not_formed.is_none() {
        out.push(format!(
            "raw windows: {} star rows have none; nothing formed anew is adopted, so that every row counts with its own centroid, but ways to form them are compared on the others alone",
            w.rows_without
        ));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_amiss_is_told() {
        let whole = Windows {
            used: 40,
            ..Windows::default()
        };
        let said = |w: &Windows| sentences(Some(w)).join("\n");
        assert_eq!(said(&whole), "");
        assert!(sentences(None).is_empty());
        let in_part = Windows {
            unused: 2,
            rows_without: 10,
            ..whole.clone()
        };
        let all = said(&in_part);
        assert!(
            all.contains("2 of 42") && all.contains("10 star rows have none"),
            "{all}"
        );
        let left_out = said(&Windows {
            rows_left_out: 11,
            ..in_part.clone()
        });
        assert!(left_out.contains("11 star rows are left out"), "{left_out}");
        assert!(!left_out.contains("have none"), "{left_out}");
        let few = said(&Windows {
            not_formed: Some("they are of 20 frames, and at least 30 are needed".to_owned()),
            ..in_part
        });
        assert!(
            few.contains("none of 42 can be used: they are of 20 frames"),
            "{few}"
        );
        assert!(!few.contains("every row counts"), "{few}");
    }
}
