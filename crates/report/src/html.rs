//! `report.html`: a run of the loop for people, one file without script or anything from elsewhere.
//!
//! The document is well-formed XML as well. A number out of `report.json` stands in an element
//! `<data value="..." data-key="...">`: the value as it is there, and the JSON pointer to it.

mod asked;
mod dark;
mod data;
mod field;
mod findings;
mod series;
mod spectrum;
mod write;

use closed_loop::Closed;
use comparison::Compared;
use telemetry::Bundle;
use telemetry::report::Verdict;

use crate::verdict::sentence;
use write::{Page, escaped};

/// What a page is about.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// What was found.
    pub closed: &'a Closed,
    /// What was measured.
    pub bundle: &'a Bundle,
    /// Which bundle and model, in the user's words.
    pub input: &'a str,
    /// Ensembles of the declared model and, if something was added, of the better one; or why there are none.
    pub compared: Result<&'a Compared, &'a str>,
}

/// The page.
#[must_use]
pub fn html(run: &Run<'_>) -> String {
    let title = run
        .bundle
        .meta
        .title
        .as_deref()
        .filter(|title| !title.trim().is_empty())
        .unwrap_or("Closed-loop report");
    let mut page = Page::new(title, STYLE);
    page.raw(&format!(
        "<header><p class=\"kind\">boresight close: from the residual to a better model</p><h1>{}</h1><p>{}</p></header>",
        escaped(title),
        escaped(run.input)
    ));
    let report = &run.closed.report;
    page.parts(&[
        &|page| verdict(page, run),
        &|page| findings::numbers(page, report),
        &|page| spectrum::residual(page, run),
        &|page| spectrum::models(page, run),
        &|page| series::over_time(page, run),
        &|page| field::focal_plane(page, run),
        &|page| field::pixel_phase(page, run),
        &|page| dark::map(page, run),
        &|page| findings::effects(page, report),
        &|page| asked::apart(page, report),
        &|page| asked::hypotheses(page, report),
        &|page| findings::rivals(page, run.closed),
        &|page| findings::considered(page, report),
        &|page| findings::leftover(page, report),
        &|page| data::rows(page, run),
        &|page| data::model(page, run),
        &reading,
    ]);
    page.finish()
}

fn reading(page: &mut Page) {
    page.section("reading", "How to read this page", |page| {
        page.paragraph(READING);
        page.raw(&format!(
            "<p>Made by boresight {}. The same numbers for machines: <code>report.json</code>; every row: the tables <code>residuals_*.parquet</code> beside it.</p>",
            env!("CARGO_PKG_VERSION")
        ));
    });
}

const READING: &str = "Before is the declared model at its best: all that it declares unknown (misalignment, directions, distortion within its prior) is estimated too. After adds only the effects listed. Every residual, rms, gain and share is out of fold: each block of time is predicted from the others, so nothing here is the quality of a fit to its own data. Gains are differences of log-likelihood in nats; p-values have paid for the whole search; ± is 1σ. Detectable is the size that this data would have shown at 5σ, needed the size that would explain the residual by itself.";

fn verdict(page: &mut Page, run: &Run<'_>) {
    let report = &run.closed.report;
    let class = match report.verdict {
        Verdict::Consistent => "consistent",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly_explained",
        Verdict::Unexplained => "unexplained",
    };
    let said = sentence(report);
    let said = match report.verdict {
        Verdict::Consistent => format!("consistent: {said}"),
        Verdict::Unexplained => format!("unexplained: {said}"),
        Verdict::Explained | Verdict::PartlyExplained => said,
    };
    page.section("verdict", "Verdict", |page| {
        page.raw(&format!(
            "<p class=\"verdict {class}\"><strong>{}.</strong></p>",
            escaped(&capitalised(&said))
        ));
        findings::in_a_line_each(page, report);
        data::in_a_line(page, run);
    });
}

fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(chars).collect()
    })
}

const STYLE: &str = "
:root { color-scheme: light; }
body { font: 15px/1.5 'DejaVu Sans', Verdana, Arial, sans-serif; color: #20242a; background: #ffffff; max-width: 1120px; margin: 1.5rem auto; padding: 0 1rem; }
h1 { font-size: 1.45rem; line-height: 1.25; margin: .1rem 0 .4rem; }
h2 { font-size: 1.12rem; margin: 2rem 0 .5rem; padding-bottom: .2rem; border-bottom: 2px solid #20242a; }
header p { margin: 0; overflow-wrap: anywhere; }
.kind { color: #50565e; }
.verdict { font-size: 1.12rem; padding: .5rem .9rem; border: 1px solid #9aa0a8; border-left: 8px solid #78808a; }
.consistent, .explained { border-left-color: #008060; }
.partly_explained { border-left-color: #e69f00; }
.unexplained { border-left-color: #d55e00; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .5rem 0 1rem; font-size: .88em; }
caption { text-align: left; padding: .2rem 0; color: #40464e; min-width: 30rem; }
th, td { padding: .22rem .7rem .22rem 0; border-bottom: 1px solid #d3d7dc; text-align: left; vertical-align: top; }
thead th { border-bottom: 1.5px solid #20242a; }
tbody th { font-weight: normal; }
.n { text-align: right; font-variant-numeric: tabular-nums; }
.n, .v { white-space: nowrap; }
figure { margin: .6rem 0 1.4rem; }
svg[role] { display: block; max-width: 100%; height: auto; }
figcaption { max-width: 62rem; }
pre { background: #f4f5f7; border: 1px solid #d3d7dc; padding: .6rem; overflow-x: auto; font-size: .85em; }
small { color: #50565e; font-size: .92em; }
@page { size: A4; margin: 14mm; }
@media print { body { max-width: none; margin: 0; padding: 0; font-size: 9.5pt; } figure, tr, .verdict { break-inside: avoid; } h2 { break-after: avoid; } .wide { overflow: visible; } pre { white-space: pre-wrap; } }
";
