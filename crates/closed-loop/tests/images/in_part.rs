//! Windows of some star rows only, or of none.
//!
//! Not physics: tests.

use std::collections::BTreeSet;

use closed_loop::{Questions, close_asking};
use telemetry::report::Windows;
use telemetry::{Bundle, Model};

use super::scene::{Scene, WIDE, ids, keep_rows, population, run};
use super::small;

/// Rows of a table by time and slot.
type Keys = BTreeSet<(u64, i32)>;

/// The keys that `keep` takes of all windows.
fn chosen(bundle: &Bundle, keep: impl Fn(usize, f64, i32) -> bool) -> Keys {
    let images = bundle.images.as_ref();
    let keys = images
        .map(|i| i.t_s.iter().zip(&i.slot))
        .into_iter()
        .flatten();
    let taken = keys.enumerate().filter(|(i, (t, s))| keep(*i, **t, **s));
    taken.map(|(_, (t, s))| (t.to_bits(), *s)).collect()
}

/// Windows that are missing here and there, or in one piece, leave what the others tell: bit by bit what is found
/// where the rows without windows were never sent. They are counted.
#[test]
fn rows_without_windows_change_nothing_of_what_the_others_tell() {
    let whole = Scene {
        frames: 200,
        motion: small,
        warm: population(0.15, 60.0, &WIDE, 7),
        ..Scene::default()
    }
    .make();
    let scattered = chosen(&whole, |i, _, _| (i * 7919) % 101 % 4 != 0);
    let first_half = chosen(&whole, |_, t_s, _| t_s < 200.0);
    for (name, keys) in [("scattered", scattered), ("first half", first_half)] {
        let kept = |t_s: f64, slot: i32| keys.contains(&(t_s.to_bits(), slot));
        let in_part = run(&keep_rows(&whole, |_, _| true, kept));
        let alone = run(&keep_rows(&whole, kept, kept));
        assert_eq!(ids(&in_part), ["dark_map"], "{name}");
        assert!(!in_part.report.unattributed.present, "{name}");
        assert_eq!(in_part.report.effects, alone.report.effects, "{name}");
        assert_eq!(in_part.report.after, alone.report.after, "{name}");
        let unformed = alone.report.windows.unwrap().rows_left_out;
        let without = 1000 - keys.len();
        let count = Windows {
            used: keys.len(),
            unused: 0,
            rows_without: without,
            rows_left_out: without + unformed,
            not_formed: None,
        };
        let rows = in_part.report.rows;
        assert_eq!(
            rows.used + rows.outliers + rows.outside_reference + count.rows_left_out,
            1000,
            "{name}: {rows:?}"
        );
        assert_eq!(in_part.report.windows, Some(count), "{name}");
    }
}

/// Where windows tell nothing, all rows say what they say without any, whichever of them have one.
#[test]
fn where_nothing_is_adopted_all_rows_count() {
    let whole = Scene {
        frames: 150,
        ..Scene::default()
    }
    .make();
    let keys = chosen(&whole, |i, _, slot| slot != 2 && i % 7 != 0);
    let kept = |t_s: f64, slot: i32| keys.contains(&(t_s.to_bits(), slot));
    let in_part = run(&keep_rows(&whole, |_, _| true, kept));
    let none = run(&Bundle {
        images: None,
        ..whole
    });
    assert!(!in_part.rivals.is_empty());
    assert_eq!(in_part.report.rows, none.report.rows);
    assert_eq!(in_part.report.effects, none.report.effects);
    assert_eq!(in_part.report.before, none.report.before);
    assert_eq!(in_part.report.after, none.report.after);
    assert_eq!(in_part.report.unattributed, none.report.unattributed);
    let count = Windows {
        used: keys.len(),
        rows_without: 750 - keys.len(),
        ..Windows::default()
    };
    assert_eq!(in_part.report.windows, Some(count));
}

/// One star that has windows has no attitude by itself, and frames have none without the others: the windows tell
/// nothing, and the reason is told.
#[test]
fn windows_of_one_star_among_free_attitudes_tell_nothing() {
    let whole = Scene {
        frames: 60,
        warm: population(0.1, 60.0, &WIDE, 5),
        ..Scene::default()
    }
    .make();
    let closed = run(&keep_rows(&whole, |_, _| true, |_, slot| slot == 1));
    let windows = closed.report.windows.unwrap();
    assert_eq!((windows.used, windows.rows_left_out), (60, 0));
    let why = windows.not_formed.unwrap();
    assert!(why.contains("do not suffice by themselves"), "{why}");
    assert_eq!(closed.report.rows.used + closed.report.rows.outliers, 300);
}

/// What is said of a dark map that is asked about.
fn finding(bundle: &Bundle) -> (String, Windows) {
    let questions = Questions::about(["dark_map"]).expect("it is in the catalogue");
    let closed = close_asking(&Model::default(), bundle, &questions, &|_| ());
    let report = closed.expect("a report").report;
    let reason = report.hypotheses[0].reason.clone();
    (
        reason.expect("a reason"),
        report.windows.expect("there are windows"),
    )
}

/// Windows of other times, and too few of them, are no windows that the bundle lacks.
#[test]
fn why_windows_tell_nothing_is_said() {
    let scene = |frames: usize| Scene {
        frames,
        ..Scene::default()
    };
    let mut late = scene(40).make();
    for t_s in &mut late.images.as_mut().unwrap().t_s {
        *t_s += 0.25;
    }
    let (reason, windows) = finding(&late);
    assert_eq!(
        (windows.used, windows.unused, windows.rows_without),
        (0, 200, 200)
    );
    assert!(reason.contains("none of the 200 raw windows"), "{reason}");
    assert!(reason.contains("time and slot of a star row"), "{reason}");
    assert!(windows.not_formed.is_some_and(|why| reason.contains(&why)));
    let (reason, windows) = finding(&scene(20).make());
    assert_eq!((windows.used, windows.unused), (100, 0));
    assert!(reason.contains("none of the 100 raw windows"), "{reason}");
    assert!(reason.contains("20 frames, and at least 30"), "{reason}");
}
