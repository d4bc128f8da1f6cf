//! Tables in plain text, aligned for a terminal.

use std::fmt;

/// The side on which the cells of a column are aligned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Align {
    /// For names.
    #[default]
    Left,
    /// For numbers.
    Right,
}

/// A table that prints with its columns aligned, two spaces apart, and a rule under the header.
///
/// ```
/// use light4gs_train::table::{Align, Table};
///
/// let mut table = Table::new([("section", Align::Left), ("bytes", Align::Right)]);
/// table.row(["gaussians", "1024"]).row(["planes", "65536"]);
/// assert_eq!(
///     table.to_string(),
///     "section    bytes\n\
///      ---------  -----\n\
///      gaussians   1024\n\
///      planes     65536\n"
/// );
/// ```
#[derive(Debug, Clone, Default)]
pub struct Table {
    header: Vec<String>,
    align: Vec<Align>,
    rows: Vec<Row>,
}

#[derive(Debug, Clone)]
enum Row {
    Cells(Vec<String>),
    Rule,
}

impl Table {
    /// A table with these columns and no rows.
    pub fn new<T: Into<String>>(columns: impl IntoIterator<Item = (T, Align)>) -> Self {
        let (header, align) = columns.into_iter().map(|(name, align)| (name.into(), align)).unzip();
        Self { header, align, rows: Vec::new() }
    }

    /// Appends a row. Missing cells stay empty; cells beyond the last column are dropped.
    pub fn row<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) -> &mut Self {
        let mut cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        cells.resize(self.header.len(), String::new());
        self.rows.push(Row::Cells(cells));
        self
    }

    /// Appends a rule, such as the one above a total.
    pub fn rule(&mut self) -> &mut Self {
        self.rows.push(Row::Rule);
        self
    }

    fn widths(&self) -> Vec<usize> {
        let mut widths: Vec<usize> = self.header.iter().map(|name| width(name)).collect();
        for row in &self.rows {
            if let Row::Cells(cells) = row {
                for (most, cell) in widths.iter_mut().zip(cells) {
                    *most = (*most).max(width(cell));
                }
            }
        }
        widths
    }
}

impl fmt::Display for Table {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        let line = |cells: &[String]| {
            let padded = cells.iter().zip(&self.align).zip(&widths).map(|((cell, align), most)| {
                let space = " ".repeat(most.saturating_sub(width(cell)));
                match align {
                    Align::Left => format!("{cell}{space}"),
                    Align::Right => format!("{space}{cell}"),
                }
            });
            padded.collect::<Vec<_>>().join("  ")
        };
        let rule = widths.iter().map(|most| "-".repeat(*most)).collect::<Vec<_>>().join("  ");
        writeln!(formatter, "{}", line(&self.header).trim_end())?;
        writeln!(formatter, "{rule}")?;
        for row in &self.rows {
            match row {
                Row::Cells(cells) => writeln!(formatter, "{}", line(cells).trim_end())?,
                Row::Rule => writeln!(formatter, "{rule}")?,
            }
        }
        Ok(())
    }
}

/// Width in columns of a terminal. Our own text has one column for each character.
fn width(text: &str) -> usize {
    text.chars().count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_and_long_rows_fit() {
        let mut table = Table::new([("a", Align::Right), ("name", Align::Left)]);
        table.row(["1"]).rule().row(["22", "grün", "dropped"]);
        assert_eq!(table.to_string(), " a  name\n--  ----\n 1\n--  ----\n22  grün\n");
    }

    #[test]
    fn an_empty_table_is_its_header() {
        assert_eq!(Table::new([("x", Align::Left)]).to_string(), "x\n-\n");
    }
}
