//! The example of `docs/compare.md`, run as a user would run it.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

type Done = Result<(), Box<dyn std::error::Error>>;

#[test]
fn the_lines_of_the_page_run() -> Done {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = fs::read_to_string(root.join("docs/compare.md"))?;
    let lines = page
        .split("```sh\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next());
    let dir = tempfile::tempdir()?;
    for line in lines.ok_or("the page has an example")?.lines() {
        let mut words = line.split_whitespace();
        assert_eq!(words.next(), Some("boresight"));
        let words = words.map(|word| match word.strip_prefix("fixtures/") {
            Some(rest) => root.join("fixtures").join(rest).into_os_string(),
            None => word.into(),
        });
        let done = Command::new(env!("CARGO_BIN_EXE_boresight"))
            .current_dir(dir.path())
            .args(words)
            .output()?;
        assert!(
            done.status.success(),
            "{line}: {}",
            String::from_utf8_lossy(&done.stderr)
        );
    }
    let report: Value =
        serde_json::from_slice(&fs::read(dir.path().join("figures/compare.json"))?)?;
    assert_eq!(report["others"][0]["kind"], "hem");
    assert_eq!(report["model"]["stars"], "telemetry");
    let mut pictures = 0;
    for folder in ["pictures", "figures"] {
        for entry in fs::read_dir(dir.path().join(folder))? {
            let path = entry?.path();
            let name = path
                .file_name()
                .and_then(|n| n.to_str())
                .ok_or("a name")?
                .to_owned();
            assert!(
                page.contains(&format!("`{name}`")),
                "{name} is not on the page"
            );
            if name.ends_with(".svg") {
                let svg = fs::read_to_string(&path)?;
                assert!(
                    svg.starts_with("<svg") && svg.ends_with("</svg>\n"),
                    "{name}"
                );
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name}");
                pictures += 1;
            }
        }
    }
    assert_eq!(pictures, 6 + 6);
    Ok(())
}
