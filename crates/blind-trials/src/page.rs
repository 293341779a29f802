//! The page in `docs/`.
//!
//! Not physics: text.

use std::collections::BTreeMap;

use crate::tally::at_least;
use crate::{Done, Score, Tally, Trial};

/// Share of bundles that follow their model and may be given an effect.
const DESIGN: f64 = 0.01;
const FIRST: &str = "## The first seed of each";

/// The page; `command` is the line that makes it.
#[must_use]
pub fn page(trials: &[Trial], done: &[Done], tallies: &[Tally], command: &str) -> String {
    let all: Vec<(&Trial, &Tally)> = trials.iter().zip(tallies).collect();
    let of = |what: fn(&Trial) -> bool| -> Vec<(&Trial, &Tally)> {
        all.iter()
            .copied()
            .filter(|(trial, _)| what(trial))
            .collect()
    };
    let acts = |t: &Trial| !t.truth.effect.is_empty() && t.truth.outside.is_empty();
    let (pixel_nulls, model_nulls) = (
        of(|t| is_null(t) && !is_model(t)),
        of(|t| is_model(t) && !has_size(t)),
    );
    let distorted = of(|t| is_model(t) && has_size(t));
    let known: Vec<_> = all
        .iter()
        .copied()
        .filter(|(trial, _)| acts(trial) && !is_model(trial))
        .collect();
    let outside = of(|t| !t.truth.outside.is_empty());
    let mut text = format!(
        "# Blind trials\n\n\
         Made by `{command}`. Every world of `fixtures/worlds` is rendered ([imager.md](imager.md)), the loop is \
         closed on it with the model that an analyst would declare, and the report is held against what acts; \
         the loop is given the bundle and the model alone. Nothing here is tuned, and no seed is left out. \
         How the counts are made stands at the end.\n\n"
    );
    text.push_str(&summary(
        &pixel_nulls,
        &model_nulls,
        &known,
        &distorted,
        &outside,
    ));
    text.push_str("## Nothing acts\n\nWritten: effects found that do not act, and how often. The design rate is 1 %.\n\n");
    text.push_str("| bundles | of them with a false effect | which | left over although nothing is | c/e/p/u |\n|---|---|---|---|---|\n");
    for (trial, tally) in pixel_nulls.iter().chain(&model_nulls) {
        let left = tally.leftover.values().sum::<usize>();
        let left = match left {
            0 => "0".to_owned(),
            n => format!("{n}: {}", counted(&tally.leftover)),
        };
        text.push_str(&format!(
            "| `{}`, {} | {} | {} | {left} | {} |\n",
            trial.name,
            tally.runs,
            tally.with_extra,
            counted(&tally.extra),
            verdicts(tally)
        ));
    }
    text.push_str("\n## Effects of the catalogue act\n\n");
    text.push_str(&effects(&known));
    if !distorted.is_empty() {
        text.push_str("\n## Effects act beside a declared distortion\n\n");
        text.push_str(&effects(&distorted));
    }
    text.push_str(
        "\n## Something acts that is in no catalogue\n\n\
         | world | bundles | honest | c/e/p/u | the leftover follows | named although it does not act | before, after over floor |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (trial, tally) in &outside {
        text.push_str(&format!(
            "| `{}` | {} | {} | {} | {} | {} | {} |\n",
            trial.name,
            tally.runs,
            tally.honest,
            verdicts(tally),
            counted(&tally.leftover),
            counted(&tally.extra),
            over(tally)
        ));
    }
    text.push_str(
        "\n## Parameters\n\n\
         | world | parameter | unit | truth | in | mean | scatter | bound | scatter/bound | rms z |\n\
         |---|---|---|---|---|---|---|---|---|---|\n",
    );
    for (trial, tally) in known.iter().chain(&distorted) {
        for row in &tally.parameters {
            let ratio = row.bound.map(|bound| row.scatter / bound);
            text.push_str(&format!(
                "| `{}` | `{}` | {} | {} | {} | {} | {} | {} | {} | {} |\n",
                trial.name,
                row.name,
                row.unit,
                number(row.truth),
                row.count,
                number(row.mean),
                number(row.scatter),
                row.bound.map_or("–".to_owned(), number),
                ratio.map_or("–".to_owned(), fixed),
                fixed(row.z)
            ));
        }
    }
    text.push_str(&format!(
        "\n{FIRST}\n\n`cargo xtask blind --check` computes these again and fails if one differs.\n\n\
         | bundle | verdict | effects | left over |\n|---|---|---|---|\n"
    ));
    for (trial, done) in trials.iter().zip(done) {
        if let Some(score) = done.first() {
            text.push_str(&first(trial, score));
        }
    }
    text.push_str(HOW);
    text
}

const HOW: &str = "\n## How the counts are made\n\n\
- **c/e/p/u**: verdicts *consistent*, *explained*, *partly explained*, *unexplained*.\n\
- **Right**: the id, and every selector of the truth (channel, star). Each effect that acts answers for one found; a second of its kind counts among others. In pairs either may be first.\n\
- **Seeds**: a new detector, new noise and, where it is random, a new motion each. Worlds with windows, on which the loop takes twenty times as long, have a quarter of the seeds, at least one; simulated bundles have four times as many. The same seed of `model_hold_*` or of `model_slews_*` has the same noise of the stars, so that one alarm is often seen in several.\n\
- **A value off by 5σ**: |estimate − truth| over the σ that the report gives, of parameters that the world's truth names. **rms z** is the root mean square of the same ratio: 1 if the σ's are honest, with a scatter of 1/√(2n). An instant has an interval in place of a σ: it holds the truth or not. Effects near the limit are found where noise helps them, so that those few found are too large.\n\
- **scatter**: rms of estimate − truth over the bundles in which it was found. In all: the root mean square of its ratio to the bound, of those parameters that have one, and 1/√(2n).\n\
- **bound**: Cramér–Rao, from differences of runs rendered without noise with the instrument's setting ± 10 %, the noise of each star's centroids and the reference's declared white error, for somebody who knows which effects act and estimates the truth's parameters and a constant misalignment (`crates/blind-trials/src/bound.rs::bounds`). It shares no regressor with the loop. A loop that also fits what is 0 (a third axis, k2, the decentring) must lie above it; an instant, a frequency or a pixel has none.\n\
- **floor**: what perfect knowledge of everything but the noise leaves: the same bundle less the same run rendered without noise, less a constant misalignment (without a reference: less every frame's own rotation), over the rows in the loop's own figures. *After over floor* should be 0 within 2 %. Where positions are fitted to windows it may be below: such a fit has less noise than the centroids.\n\
- **honest**: something is left, its first variable is one that the truth allows, and nothing is named that does not act.\n\
- **Simulated nulls** (`model_*`): the tracker of the papers with all its declared errors, by the physics-based model; the declared temporal noise is 0.8 or 1.2 of the true one, or the reference has 0.5″ of white error or wanders by 0.5″ with 60 s; where it wanders, `reference_error` is right.\n\
- **Beside a declared distortion** (`distorted_*`): the same tracker, each seed with a distortion of its own by the declared law; acts what a distortion imitates, at some six to ten standard errors, most of which the distortion makes. The effect itself is simulated by the same formulas as it is sought with; what is tried is the law of what is declared, on which every σ hangs here.\n";

/// One row a world of what was found where effects act.
fn effects(rows: &Rows<'_>) -> String {
    let mut text = String::from(
        "| world | bundles | right one first | all found | these and no other | others named | a value off by 5σ | c/e/p/u | before, after over floor |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for (trial, tally) in rows {
        text.push_str(&format!(
            "| `{}` | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            trial.name,
            tally.runs,
            tally.first,
            tally.all,
            tally.exact,
            counted(&tally.extra),
            tally.off,
            verdicts(tally),
            over(tally)
        ));
    }
    text
}

/// Whether an effect of a known size acts.
fn has_size(trial: &Trial) -> bool {
    trial.truth.effect.iter().any(|e| !e.values.is_empty())
}

fn is_model(trial: &Trial) -> bool {
    trial.world().is_none()
}

fn is_null(trial: &Trial) -> bool {
    trial.truth.effect.is_empty() && trial.truth.outside.is_empty()
}

type Rows<'a> = [(&'a Trial, &'a Tally)];

fn summary(
    pixel: &Rows<'_>,
    model: &Rows<'_>,
    known: &Rows<'_>,
    distorted: &Rows<'_>,
    outside: &Rows<'_>,
) -> String {
    let sum = |rows: &Rows<'_>, of: &dyn Fn(&Tally) -> usize| -> usize {
        rows.iter().map(|(_, tally)| of(tally)).sum()
    };
    let share =
        |k: usize, n: usize| format!("{k} of {n} ({:.0} %)", 100.0 * k as f64 / n.max(1) as f64);
    let mut text = String::from("| | |\n|---|---|\n");
    let mut line = |what: &str, value: String| text.push_str(&format!("| {what} | {value} |\n"));
    let alarms = |rows: &Rows<'_>| {
        let (k, n) = (sum(rows, &|t| t.with_extra), sum(rows, &|t| t.runs));
        let chance = at_least(k, n, DESIGN);
        format!("{k} of {n} (chance of as many at 1 %: {})", number(chance))
    };
    if !pixel.is_empty() {
        line("false alarms, rendered nulls", alarms(pixel));
    }
    if !model.is_empty() {
        line("false alarms, simulated nulls", alarms(model));
    }
    let (single, pairs): (Vec<_>, Vec<_>) = known
        .iter()
        .copied()
        .partition(|(trial, _)| trial.truth.effect.len() == 1);
    for (what, rows) in [("one effect", single), ("two effects", pairs)] {
        let n = sum(&rows, &|t| t.runs);
        if n == 0 {
            continue;
        }
        line(
            &format!("{what}: a right one first"),
            share(sum(&rows, &|t| t.first), n),
        );
        line(
            &format!("{what}: all found"),
            share(sum(&rows, &|t| t.all), n),
        );
        line(
            &format!("{what}: all found and no other named"),
            share(sum(&rows, &|t| t.exact), n),
        );
    }
    let rms_z = |rows: &Rows<'_>| {
        let sum = |(s, n), (_, t): &(_, &Tally)| (s + t.z.0, n + t.z.1);
        let (squares, n) = rows.iter().fold((0.0, 0), sum);
        format!("{} ({n} values)", fixed((squares / n as f64).sqrt()))
    };
    if !known.is_empty() {
        line("rms z of all parameters", rms_z(known));
        let bounded = known.iter().flat_map(|(_, t)| &t.parameters);
        let (squares, n) = bounded
            .filter_map(|row| Some((row.count as f64, row.scatter / row.bound?)))
            .fold((0.0, 0.0), |(s, n), (count, over)| {
                (s + count * over * over, n + count)
            });
        line(
            "scatter of all parameters over the bound",
            format!(
                "{} ± {} ({n} values)",
                fixed((squares / n).sqrt()),
                fixed((0.5 / n).sqrt())
            ),
        );
        let held = [0, 1].map(|k| sum(known, &|t| t.held[k]));
        line(
            "intervals of 95 % that hold the truth",
            share(held[0], held[1]),
        );
        let within = [0, 1].map(|k| sum(known, &|t| t.within[k]));
        line(
            "after within 2 % of perfect knowledge",
            share(within[0], within[1]),
        );
    }
    if !distorted.is_empty() {
        let n = sum(distorted, &|t| t.runs);
        line(
            "beside a declared distortion: the right one first",
            share(sum(distorted, &|t| t.first), n),
        );
        line(
            "beside a declared distortion: it and no other named",
            share(sum(distorted, &|t| t.exact), n),
        );
        line("beside a declared distortion: rms z", rms_z(distorted));
    }
    if !outside.is_empty() {
        let n = sum(outside, &|t| t.runs);
        line(
            "in no catalogue: told honestly",
            share(sum(outside, &|t| t.honest), n),
        );
        line(
            "in no catalogue: a catalogue effect named",
            share(sum(outside, &|t| t.with_extra), n),
        );
    }
    text.push('\n');
    text
}

/// What one report says, as a row of the table of first seeds.
#[must_use]
pub fn first(trial: &Trial, score: &Score) -> String {
    let claims: Vec<String> = score
        .claims
        .iter()
        .map(|c| {
            format!(
                "{}{}",
                c.id,
                if c.right.is_some() {
                    ""
                } else {
                    " (does not act)"
                }
            )
        })
        .collect();
    let or_none = |text: String| {
        if text.is_empty() {
            "–".to_owned()
        } else {
            text
        }
    };
    format!(
        "| `{}` | {:?} | {} | {} |\n",
        trial.name,
        score.verdict,
        or_none(claims.join(", ")),
        or_none(score.leftover.clone().unwrap_or_default())
    )
}

/// Rows of the table of first seeds that differ between an old page and what is computed now.
#[must_use]
pub fn differences(old: &str, trials: &[Trial], done: &[Done]) -> Vec<String> {
    let table = old.split_once(FIRST).map_or("", |(_, after)| after);
    let mut out = Vec::new();
    for (trial, done) in trials.iter().zip(done) {
        let start = format!("| `{}` |", trial.name);
        let was = table.lines().find(|line| line.starts_with(&start));
        let is = done
            .first()
            .map(|score| first(trial, score))
            .unwrap_or_default();
        if was != Some(is.trim_end()) {
            let was = was.unwrap_or("no such row");
            out.push(format!("was {was}\nis  {}", is.trim_end()));
        }
    }
    out
}

/// Most frequent first, then by name.
fn counted(counts: &BTreeMap<String, usize>) -> String {
    let mut list: Vec<(&String, &usize)> = counts.iter().collect();
    list.sort_by_key(|(name, count)| (std::cmp::Reverse(**count), (*name).clone()));
    let list: Vec<String> = list
        .iter()
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    if list.is_empty() {
        "–".to_owned()
    } else {
        list.join(", ")
    }
}

fn verdicts(tally: &Tally) -> String {
    tally.verdicts.map(|n| n.to_string()).join("/")
}

fn over(tally: &Tally) -> String {
    if tally.over_floor[0].is_nan() {
        return "–".to_owned();
    }
    tally
        .over_floor
        .map(|ratio| format!("{:+.2} %", 100.0 * (ratio - 1.0)))
        .join(", ")
}

fn fixed(value: f64) -> String {
    if value.is_finite() {
        format!("{value:.2}")
    } else {
        "–".to_owned()
    }
}

/// Three digits.
fn number(value: f64) -> String {
    if !value.is_finite() {
        "–".to_owned()
    } else if value == 0.0 || (1e-2..1e4).contains(&value.abs()) {
        let digits = if value == 0.0 {
            0.0
        } else {
            value.abs().log10().floor()
        };
        let after = (2.0 - digits).clamp(0.0, 4.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0 to 4"
        )]
        let after = after as usize;
        format!("{value:.after$}")
    } else {
        format!("{value:.2e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Claim;
    use crate::simulated::nulls;
    use imager::Acting;
    use telemetry::report::Verdict;

    fn scored(verdict: Verdict, claims: &[(&str, Option<usize>)], found: Vec<bool>) -> Score {
        Score {
            verdict,
            claims: claims
                .iter()
                .map(|(id, right)| Claim {
                    id: (*id).to_owned(),
                    right: *right,
                })
                .collect(),
            found,
            drawn: Vec::new(),
            leftover: None,
            follows: false,
            before: 1.1,
            after: 1.0,
            floor: 1.0,
        }
    }

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.27, "0.270"),
            (-1.0e-3, "-1.00e-3"),
            (20.34, "20.3"),
            (500.0, "500"),
            (0.0123, "0.0123"),
            (f64::NAN, "–"),
            (0.0, "0.00"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    /// A page of two nulls, one of which was given an effect that does not act.
    #[test]
    fn a_page_counts_alarms_and_knows_its_first_seeds() {
        let trials = nulls().unwrap();
        let trials = vec![trials[0].clone(), trials[4].clone()];
        assert_eq!(
            trials[1].truth.effect,
            [Acting {
                id: "reference_error".into(),
                ..Acting::default()
            }]
        );
        let mut done = vec![
            vec![
                scored(Verdict::Consistent, &[], Vec::new()),
                scored(Verdict::Explained, &[("hot_pixel", None)], Vec::new()),
            ],
            vec![scored(
                Verdict::Explained,
                &[("reference_error", Some(0))],
                vec![true],
            )],
        ];
        let tallies: Vec<Tally> = trials
            .iter()
            .zip(&done)
            .map(|(trial, done)| Tally::of(trial, done, &BTreeMap::new()))
            .collect();
        let old = page(&trials, &done, &tallies, "make it");
        assert!(old.contains("Made by `make it`."), "{old}");
        assert!(
            old.contains(
                "| false alarms, simulated nulls | 1 of 3 (chance of as many at 1 %: 0.0297) |"
            ),
            "{old}"
        );
        assert!(
            old.contains("| `model_hold_as_declared`, 2 | 1 | hot_pixel 1 | 0 | 1/1/0/0 |"),
            "{old}"
        );
        assert!(
            old.contains("| `model_hold_reference_wanders` | Explained | reference_error | – |"),
            "{old}"
        );
        assert_eq!(differences(&old, &trials, &done), Vec::<String>::new());
        done[0].swap(0, 1);
        let changed = differences(&old, &trials, &done);
        assert_eq!(changed.len(), 1);
        assert!(
            changed[0].contains("hot_pixel (does not act)"),
            "{changed:?}"
        );
        assert_eq!(differences("", &trials, &done).len(), 2);
    }

    /// Effects beside a declared distortion are counted by themselves, not among the rendered worlds or the nulls.
    #[test]
    fn effects_beside_a_distortion_have_a_section() {
        let mut trials = crate::simulated().unwrap();
        trials.retain(|t| t.name == "distorted_scan_rolling_shutter");
        let right = scored(
            Verdict::Explained,
            &[("rolling_shutter", Some(0))],
            vec![true],
        );
        let done = vec![vec![right]];
        let tally = Tally::of(&trials[0], &done[0], &BTreeMap::new());
        let text = page(&trials, &done, &[tally], "make it");
        for line in [
            "| beside a declared distortion: the right one first | 1 of 1 (100 %) |",
            "| `distorted_scan_rolling_shutter` | 1 | 1 | 1 | 1 | – | 0 | 0/1/0/0 | +10.00 %, +0.00 % |",
        ] {
            assert_eq!(text.matches(line).count(), 1, "{line}: {text}");
        }
        assert!(!text.contains("simulated nulls |") && !text.contains("one effect"));
    }

    /// A right effect in a rendered world stands in the tables of effects and parameters.
    #[test]
    fn worlds_with_effects_have_rows() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/worlds");
        let trial = Trial::read(&folder.join("time_tag_offset.toml")).unwrap();
        let mut score = scored(
            Verdict::Explained,
            &[("time_tag_offset", Some(0))],
            vec![true],
        );
        score.drawn = vec![crate::Drawn {
            acting: 0,
            name: "offset_s".into(),
            unit: "s".into(),
            value: -1.1e-3,
            z: -0.5,
            held: None,
        }];
        let (trials, done) = (vec![trial], vec![vec![score]]);
        let bounds = [((0, "offset_s".to_owned()), 2e-4)].into();
        let tallies = vec![Tally::of(&trials[0], &done[0], &bounds)];
        let text = page(&trials, &done, &tallies, "x");
        assert!(
            text.contains(
                "| `time_tag_offset` | 1 | 1 | 1 | 1 | – | 0 | 0/1/0/0 | +10.00 %, +0.00 % |"
            ),
            "{text}"
        );
        assert!(text.contains("| `time_tag_offset` | `time_tag_offset offset_s` | s | -1.00e-3 | 1 | -1.10e-3 | 1.00e-4 | 2.00e-4 | 0.50 | 0.50 |"), "{text}");
        assert!(
            text.contains("| one effect: a right one first | 1 of 1 (100 %) |"),
            "{text}"
        );
        assert!(
            text.contains("| scatter of all parameters over the bound | 0.50 ± 0.71 (1 values) |"),
            "{text}"
        );
    }
}
