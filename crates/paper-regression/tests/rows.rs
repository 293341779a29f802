//! Every row is computed: from the inputs, and from nothing else.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use paper_regression::{Group, Inputs, m23, page};

/// Enough to compute every row, not enough for their verdicts.
fn little() -> Inputs {
    Inputs {
        fields: 2,
        draws: 3,
        flights: 2,
        duration: 0.12,
        ..Inputs::default()
    }
}

fn rows(groups: &[Group]) -> BTreeMap<String, String> {
    let rows = groups.iter().flat_map(|group| &group.rows);
    rows.map(|row| (row.id.clone(), row.ours.clone())).collect()
}

/// The rows that follow from the temporal noise change with it; those of geometry, motion and distortion
/// do not. Names are unique, and each is on the page in `docs/`.
#[test]
fn rows_follow_their_inputs() {
    let inputs = little();
    let groups = m23::groups(&inputs).unwrap();
    let count: usize = groups.iter().map(|group| group.rows.len()).sum();
    let before = rows(&groups);
    assert_eq!(before.len(), count, "names are unique");
    let louder = Inputs {
        sigma_tn_arcsec: 3.0 * inputs.sigma_tn_arcsec,
        ..inputs
    };
    let after = rows(&m23::groups(&louder).unwrap());
    for (id, ours) in &before {
        assert!(!ours.contains("NaN"), "{id}: {ours}");
        let still = [
            "drift as",
            "distance in",
            "period of",
            "distortion in the hold",
            "distortion and the number",
            "boresight to cross-axis",
            "LSFE",
            "work per frame",
        ];
        if id == "mode in the hybrid model" {
            // that nothing shows there is its claim
            continue;
        }
        let expected = !still.iter().any(|word| id.contains(word));
        assert_eq!(
            after[id] != *ours,
            expected,
            "{id}: {ours} and {}",
            after[id]
        );
    }
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/paper-regression.md");
    let current = fs::read_to_string(docs).unwrap();
    for id in before.keys() {
        assert!(
            current.contains(&format!("| {id} |")),
            "`{id}` is not in docs"
        );
    }
    // the page holds the other paper's rows too; its being current is checked by the command
    let rows = |text: &str| text.lines().filter(|l| l.starts_with('|')).count();
    assert!(rows(&page(&groups)) <= rows(&current));
}

/// The distortion enters where the paper says, and the centroid error.
#[test]
fn other_sigmas_change_their_rows() {
    let inputs = Inputs {
        duration: 0.04,
        ..little()
    };
    let bent = Inputs {
        sigma_lsf_arcsec: 2.0 * inputs.sigma_lsf_arcsec,
        ..inputs
    };
    let [before, after] =
        [inputs, bent].map(|inputs| rows(&[m23::specification(&inputs).unwrap()]));
    assert_ne!(
        before["LSFE about the boresight"],
        after["LSFE about the boresight"]
    );
    assert_eq!(
        before["NEA about the boresight"],
        after["NEA about the boresight"]
    );
    let folded = Inputs {
        sigma_hsf_arcsec: 2.0 * inputs.sigma_hsf_arcsec,
        ..inputs
    };
    let [before, after] = [inputs, folded].map(|inputs| rows(&[m23::readings(&inputs).unwrap()]));
    assert!(
        before
            .iter()
            .filter(|(id, ours)| after[*id] != **ours)
            .count()
            > 20
    );
}

/// The same numbers for any number of threads.
#[test]
fn threads_change_nothing() {
    let inputs = Inputs {
        duration: 0.04,
        ..little()
    };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| m23::readings(&inputs).unwrap())
    };
    assert_eq!(with(1), with(3));
}

/// The command says how it is used rather than compute for minutes.
#[test]
fn wrong_words_are_answered_at_once() {
    for words in [
        &[][..],
        &["--check"],
        &["--chek", "page.md"],
        &["a.md", "b.md"],
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_paper-regression"));
        let done = command.args(words).output().unwrap();
        assert_eq!(done.status.code(), Some(2), "{words:?}");
        assert!(String::from_utf8_lossy(&done.stderr).starts_with("usage: "));
    }
}
