//! Tables in Markdown.

/// One row: the line it stands on (1-based) and its cells, trimmed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row<'a> {
    pub(crate) line: usize,
    pub(crate) cells: Vec<&'a str>,
}

impl<'a> Row<'a> {
    /// A cell, or the empty text where the row is short.
    pub(crate) fn cell(&self, column: usize) -> &'a str {
        self.cells.get(column).copied().unwrap_or_default()
    }
}

/// The rows of the first table whose header starts with these cells; `None`
/// where there is no such table.
pub(crate) fn rows<'a>(text: &'a str, header: &[&str]) -> Option<Vec<Row<'a>>> {
    let mut lines = text.lines().enumerate();
    lines.find(|(_, line)| cells(line).is_some_and(|cells| cells.starts_with(header)))?;
    let is_rule = |row: &Row<'_>| {
        row.cells
            .iter()
            .all(|cell| !cell.is_empty() && cell.chars().all(|c| c == '-' || c == ':'))
    };
    Some(
        lines
            .map_while(|(index, line)| {
                let cells = cells(line)?;
                Some(Row {
                    line: index + 1,
                    cells,
                })
            })
            .filter(|row| !is_rule(row))
            .collect(),
    )
}

/// The cells of a line of a table. A bar inside code or after a backslash does
/// not part cells.
fn cells(line: &str) -> Option<Vec<&str>> {
    let inner = line.trim().strip_prefix('|')?.strip_suffix('|')?;
    let mut cells = Vec::new();
    let (mut start, mut in_code, mut escaped) = (0, false, false);
    for (at, c) in inner.char_indices() {
        match c {
            '`' => in_code = !in_code,
            '|' if !in_code && !escaped => {
                cells.push(inner[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
        escaped = c == '\\';
    }
    cells.push(inner[start..].trim());
    Some(cells)
}

/// What stands between backticks.
pub(crate) fn code(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
# Title

| other | table |
|---|---|
| a | b |

| crate | layer | notes |
|:--|---|---|
| `x` | 0 | a \\| b, `c|d` |
| `y` | 1 | |

| crate | layer | notes |
|---|---|---|
| `z` | 2 | |
";

    #[test]
    fn rows_are_those_of_the_first_table_with_the_header() {
        let rows = rows(TEXT, &["crate", "layer"]).unwrap();
        assert_eq!(rows.len(), 2);
        assert_eq!(
            rows[0],
            Row {
                line: 9,
                cells: vec!["`x`", "0", "a \\| b, `c|d`"]
            }
        );
        assert_eq!(rows[1].cells, ["`y`", "1", ""]);
        assert_eq!(rows[1].cell(7), "");
    }

    #[test]
    fn a_missing_table_is_not_an_empty_one() {
        assert!(rows(TEXT, &["crate", "depth"]).is_none());
        assert_eq!(rows("| a | b |\n|---|---|\n", &["a"]), Some(vec![]));
    }

    #[test]
    fn code_is_between_backticks() {
        assert_eq!(code("`a`, b and `c::d`"), ["a", "c::d"]);
        assert!(code("none").is_empty());
    }
}
