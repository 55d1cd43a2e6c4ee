//! Tables of means with standard errors, as Markdown and as CSV.

use std::error::Error;
use std::path::PathBuf;

/// The sign between a mean and its standard error.
const PLUS_MINUS: &str = " +- ";

/// Prints tables and writes them as CSV.
pub(crate) struct Output {
    folder: Option<PathBuf>,
}

impl Output {
    /// Output that goes into `folder` too, if there is one.
    pub(crate) const fn into(folder: Option<PathBuf>) -> Self {
        Self { folder }
    }

    /// Prints a table, and writes it as CSV if a folder was given.
    #[expect(clippy::print_stdout, reason = "an example shows its result")]
    pub(crate) fn table(
        &self,
        file: &str,
        title: &str,
        rows: &[Vec<String>],
    ) -> Result<(), Box<dyn Error>> {
        println!("\n{title}\n");
        for (number, row) in rows.iter().enumerate() {
            println!("| {} |", row.join(" | "));
            if number == 0 {
                println!("|{}", "---|".repeat(row.len()));
            }
        }
        self.write(file, &csv(rows))
    }

    /// Writes a text into a file of the folder, if one was given.
    pub(crate) fn write(&self, file: &str, text: &str) -> Result<(), Box<dyn Error>> {
        if let Some(folder) = &self.folder {
            let path = folder.join(file);
            std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        Ok(())
    }
}

/// The rows with an error column after each that has errors.
fn csv(rows: &[Vec<String>]) -> String {
    let with_error = |column: usize| {
        rows.get(1)
            .is_some_and(|row| row[column].contains(PLUS_MINUS))
    };
    let mut lines = Vec::new();
    for (number, row) in rows.iter().enumerate() {
        let cells: Vec<String> = row
            .iter()
            .enumerate()
            .map(|(column, cell)| {
                let cell = cell.replace(',', "");
                if number == 0 && with_error(column) {
                    format!("{cell},{cell} error")
                } else {
                    cell.replace(PLUS_MINUS, ",")
                }
            })
            .collect();
        lines.push(cells.join(",") + "\n");
    }
    lines.concat()
}

/// The first row of a table.
pub(crate) fn head(names: &[&str]) -> Vec<String> {
    names.iter().map(ToString::to_string).collect()
}

/// A cell with a mean and its standard error.
pub(crate) fn plus_minus((mean, error): (f64, f64)) -> String {
    format!("{mean:.3}{PLUS_MINUS}{error:.3}")
}
