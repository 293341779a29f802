//! Every row is computed: from the inputs, and from nothing else.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;

use paper_regression::{Group, Inputs, a01, m23};

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
            "bias",
            "work per frame",
            "how fast stars move",
            "camera's uncertainty",
            "migration of the stars",
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
    assert_sections(&groups);
}

/// Names of the rows in each section of the page in `docs/`, by its heading.
fn sections() -> BTreeMap<String, Vec<String>> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/paper-regression.md");
    let mut sections = BTreeMap::new();
    let mut title = None;
    for line in fs::read_to_string(docs).expect("the page").lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            assert!(
                sections.insert(heading.to_owned(), vec![]).is_none(),
                "`{heading}` twice"
            );
            title = Some(heading.to_owned());
        } else if let Some(cells) = line.strip_prefix("| ") {
            let id = cells.split(" | ").next().expect("a first cell");
            if id != "claim" {
                let rows = title.as_ref().and_then(|title| sections.get_mut(title));
                rows.expect("a heading above the row").push(id.to_owned());
            }
        }
    }
    sections
}

/// The section of each group holds its rows in their order, and no other. Whether their numbers are
/// current is checked by the command.
fn assert_sections(groups: &[Group]) {
    let sections = sections();
    for group in groups {
        let ids: Vec<&str> = group.rows.iter().map(|row| row.id.as_str()).collect();
        let on_page = sections.get(group.title).map_or(&[][..], Vec::as_slice);
        assert_eq!(on_page, ids, "{}", group.title);
    }
}

/// Every group of both papers has its section, and every section its group; those of the second paper
/// are held to their rows here, those of the first where its rows are computed.
#[test]
fn sections_are_the_groups() {
    let a01 = a01::groups().unwrap();
    assert_sections(&a01);
    let m23 = m23::groups(&Inputs {
        duration: 0.04,
        ..little()
    })
    .unwrap();
    let titles: BTreeSet<&str> = m23.iter().chain(&a01).map(|group| group.title).collect();
    let sections = sections();
    let on_page: BTreeSet<&str> = sections.keys().map(String::as_str).collect();
    assert_eq!(titles, on_page);
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
