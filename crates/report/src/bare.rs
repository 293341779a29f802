//! A report of nothing, for tests.
//!
//! Not physics: a helper of tests.

use telemetry::report::{Errors, REPORT_FORMAT, Report, Rows, Unattributed, Verdict};

pub(crate) fn report(verdict: Verdict) -> Report {
    Report {
        format: REPORT_FORMAT.to_owned(),
        verdict,
        folds: 5,
        rows: Rows::default(),
        windows: None,
        before: Errors::default(),
        after: Errors::default(),
        effects: vec![],
        considered: vec![],
        hypotheses: vec![],
        unattributed: Unattributed::default(),
    }
}
