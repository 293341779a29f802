//! Reading recorded oracles.

use std::error::Error;
use std::path::Path;

/// Rows of a table under `fixtures/oracles/focal-plane`, header skipped, one vector a row; the
/// first `text` columns are left out.
pub(crate) fn oracle(name: &str, text: usize) -> Result<Vec<Vec<f64>>, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures/oracles/focal-plane")
        .join(name);
    let rows = std::fs::read_to_string(path)?
        .lines()
        .skip(1)
        .map(|line| line.split(',').skip(text).map(str::parse).collect())
        .collect::<Result<Vec<_>, _>>()?;
    assert!(!rows.is_empty(), "{name} is empty");
    Ok(rows)
}
