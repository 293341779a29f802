//! Bundles that follow their model get no effect. Twelve at a family rate of 1 % raise one alarm in
//! nine such sets: these seeds raise none.

use crate::kit::{Case, Path, VELOCITY};

#[test]
fn nothing_is_found_where_nothing_acts() {
    for path in [Path::Drift, Path::Slews, Path::Turns] {
        for seed in 0..4 {
            let mut case = Case::new(path, 1000 + seed);
            case.channels = VELOCITY.to_owned();
            let report = case.close().report;
            assert!(
                report.effects.is_empty(),
                "{path:?}, seed {seed}: {:?}",
                report.effects
            );
            assert!(
                !report.unattributed.present,
                "{path:?}, seed {seed}: {:?}",
                report.unattributed
            );
        }
    }
}
