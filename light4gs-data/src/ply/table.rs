//! The vertex table of a PLY file, read with bounded memory and written atomically.
//!
//! The header is not trusted: memory grows with the bytes that are really there, never with a count in the header.

use super::header::{Element, Value, read_header, read_line, shorten};
use super::property::{Encoding, Property};
use crate::atomic::write_atomically;
use crate::error::DataError;
use crate::regular_file::open_regular_file;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

/// The vertices of a PLY file, every value as f32.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexTable {
    path: PathBuf,
    properties: Vec<Property>,
    /// `[rows, properties]`, row-major.
    values: Vec<f32>,
}

impl VertexTable {
    /// Number of vertices.
    pub fn rows(&self) -> usize {
        self.values.len() / self.properties.len().max(1)
    }

    /// The columns, in the file's order.
    pub fn properties(&self) -> &[Property] {
        &self.properties
    }

    /// Whether there is a column of this name.
    pub fn has(&self, name: &str) -> bool {
        self.properties.iter().any(|p| p.name == name)
    }

    /// The values of a column, one a vertex.
    ///
    /// # Errors
    /// [`DataError::Ply`] with the names of the existing columns, if there is none of this name.
    pub fn column(&self, name: &str) -> Result<Vec<f32>, DataError> {
        let index = self.index(name)?;
        Ok(self.values.iter().skip(index).step_by(self.properties.len()).copied().collect())
    }

    /// A column scaled so that the largest value of an integer type is 1 (floats stay as they are).
    ///
    /// # Errors
    /// As [`Self::column`].
    pub fn unit_column(&self, name: &str) -> Result<Vec<f32>, DataError> {
        let unit = self.properties[self.index(name)?].scalar.unit();
        Ok(self.column(name)?.iter().map(|v| v / unit).collect())
    }

    fn index(&self, name: &str) -> Result<usize, DataError> {
        let found = self.properties.iter().position(|p| p.name == name);
        found.ok_or_else(|| {
            let names: Vec<&str> = self.properties.iter().map(|p| p.name.as_str()).collect();
            DataError::ply(
                &self.path,
                format!("vertices have no property `{name}` (they have: {})", names.join(" ")),
                "export the file with that property",
            )
        })
    }
}

/// Reads the vertex table of a PLY file.
///
/// # Errors
/// [`DataError::Io`] when the file cannot be read; [`DataError::Ply`] when it is not a PLY file, is
/// truncated, or has a layout that is not supported (big endian, list properties of vertices, SuperSplat's compression).
pub fn read(path: &Path) -> Result<VertexTable, DataError> {
    let file = open_regular_file(path).map_err(DataError::io("read", path))?;
    let size = file.metadata().map_err(DataError::io("read", path))?.len();
    read_from(path, BufReader::new(file), size)
}

/// [`read`] from a stream of at most `size` bytes.
fn read_from(path: &Path, mut input: impl BufRead, size: u64) -> Result<VertexTable, DataError> {
    let header = read_header(path, &mut input)?;
    for element in &header.before {
        pass_over(path, element, header.encoding, &mut input)?;
    }
    let truncated = |found: usize| {
        DataError::ply(
            path,
            format!("the header promises {} vertices, the file holds {found}", header.rows),
            "the file is truncated or its header is wrong: export or copy it again",
        )
    };
    let stride: usize = header.properties.iter().map(|p| p.scalar.size()).sum();
    // In text, a value takes at least one digit and one separator.
    let smallest_row = match header.encoding {
        Encoding::Ascii => header.properties.len() * 2 - 1,
        Encoding::BinaryLittleEndian => stride,
    };
    let most_rows = size / smallest_row as u64;
    if header.rows > most_rows {
        return Err(truncated(most_rows as usize));
    }
    let rows = header.rows as usize;
    let mut values = Vec::with_capacity(rows * header.properties.len());
    match header.encoding {
        Encoding::BinaryLittleEndian => {
            let mut row = vec![0u8; stride];
            for found in 0..rows {
                input.read_exact(&mut row).map_err(|e| match e.kind() {
                    io::ErrorKind::UnexpectedEof => truncated(found),
                    _ => DataError::io("read", path)(e),
                })?;
                let mut rest = row.as_slice();
                for property in &header.properties {
                    values.push(property.scalar.decode(rest));
                    rest = &rest[property.scalar.size()..];
                }
            }
        }
        Encoding::Ascii => {
            let longest = 4096 + 64 * header.properties.len() as u64;
            for found in 0..rows {
                let too_long = || format!("the line of vertex {found} is longer than {longest} bytes");
                let line = read_line(path, &mut input, longest, too_long)?.ok_or_else(|| truncated(found))?;
                let before = values.len();
                for word in line.split_ascii_whitespace() {
                    values.push(word.parse().map_err(|_| {
                        DataError::ply(
                            path,
                            format!("vertex {found}: `{}` is not a number", shorten(word)),
                            "export the file again",
                        )
                    })?);
                }
                if values.len() - before != header.properties.len() {
                    return Err(DataError::ply(
                        path,
                        format!(
                            "vertex {found} has {} values, expected {}",
                            values.len() - before,
                            header.properties.len()
                        ),
                        "export the file again",
                    ));
                }
            }
        }
    }
    Ok(VertexTable { path: path.to_path_buf(), properties: header.properties, values })
}

/// Reads the rows of an element that stands before the vertices. It ends with the file, whatever the header promises.
fn pass_over(path: &Path, element: &Element, encoding: Encoding, input: &mut impl BufRead) -> Result<(), DataError> {
    /// A line of text may be longer than one of vertices, since it may hold a list.
    const LONGEST_LINE: u64 = 1 << 20;
    let Element { name, rows, values } = element;
    let bad = |problem: String| DataError::ply(path, problem, "export or copy the file again");
    let truncated = |found: u64| bad(format!("the header promises {rows} rows of `{name}`, the file holds {found}"));
    // Rows without values take no bytes, so their number is bounded by nothing.
    let rows = if values.is_empty() { 0 } else { *rows };
    for found in 0..rows {
        if encoding == Encoding::Ascii {
            let too_long = || format!("the line of row {found} of `{name}` is longer than {LONGEST_LINE} bytes");
            read_line(path, input, LONGEST_LINE, too_long)?.ok_or_else(|| truncated(found))?;
            continue;
        }
        for value in values {
            let bytes = match value {
                Value::One(scalar) => scalar.size() as u64,
                Value::List { count, each } => {
                    let mut length = [0; 8];
                    input.read_exact(&mut length[..count.size()]).map_err(|e| match e.kind() {
                        io::ErrorKind::UnexpectedEof => truncated(found),
                        _ => DataError::io("read", path)(e),
                    })?;
                    let problem = || bad(format!("row {found} of `{name}` has a list whose length is no whole number"));
                    count.decode_length(&length).ok_or_else(problem)? * each.size() as u64
                }
            };
            let passed = io::copy(&mut input.by_ref().take(bytes), &mut io::sink());
            if passed.map_err(DataError::io("read", path))? < bytes {
                return Err(truncated(found));
            }
        }
    }
    Ok(())
}

/// Writes a vertex table; the file is complete or absent, never half-written.
///
/// `fill(i, row)` appends the values of vertex `i` to the empty `row`, one for each property; integers are converted
/// with saturation.
///
/// # Errors
/// [`DataError::Io`] when the file cannot be written, or `fill` appended a wrong number of values.
pub fn write(
    path: &Path,
    encoding: Encoding,
    properties: &[Property],
    rows: usize,
    fill: impl FnMut(usize, &mut Vec<f32>),
) -> Result<(), DataError> {
    write_atomically(path, |out| write_to(out, encoding, properties, rows, fill))
}

/// As [`write`](fn@write), to a writer.
pub(crate) fn write_to(
    out: &mut impl Write,
    encoding: Encoding,
    properties: &[Property],
    rows: usize,
    mut fill: impl FnMut(usize, &mut Vec<f32>),
) -> io::Result<()> {
    let format = match encoding {
        Encoding::Ascii => "ascii",
        Encoding::BinaryLittleEndian => "binary_little_endian",
    };
    write!(out, "ply\nformat {format} 1.0\nelement vertex {rows}\n")?;
    for property in properties {
        writeln!(out, "property {} {}", property.scalar.name(), property.name)?;
    }
    writeln!(out, "end_header")?;
    let mut row = Vec::with_capacity(properties.len());
    let mut bytes = Vec::new();
    for i in 0..rows {
        row.clear();
        fill(i, &mut row);
        if row.len() != properties.len() {
            return Err(io::Error::other(format!(
                "row {i} has {} values for {} properties",
                row.len(),
                properties.len()
            )));
        }
        match encoding {
            Encoding::Ascii => {
                let words: Vec<String> = row.iter().map(f32::to_string).collect();
                writeln!(out, "{}", words.join(" "))?;
            }
            Encoding::BinaryLittleEndian => {
                bytes.clear();
                for (property, &value) in properties.iter().zip(&row) {
                    property.scalar.encode(value, &mut bytes);
                }
                out.write_all(&bytes)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<VertexTable, DataError> {
        read_from(Path::new("a.ply"), text.as_bytes(), text.len() as u64)
    }

    fn message(text: &str) -> String {
        parse(text).unwrap_err().to_string()
    }

    #[test]
    fn reads_every_type_and_ignores_what_follows() {
        let head = "ply\r\nformat binary_little_endian 1.0\r\ncomment hello\r\nelement vertex 1\r\n\
            property char a\r\nproperty uchar b\r\nproperty short c\r\nproperty ushort d\r\n\
            property int e\r\nproperty uint f\r\nproperty float g\r\nproperty double h\r\n\
            element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n";
        let mut bytes = head.as_bytes().to_vec();
        bytes.extend((-3i8).to_le_bytes());
        bytes.extend(200u8.to_le_bytes());
        bytes.extend((-300i16).to_le_bytes());
        bytes.extend(60000u16.to_le_bytes());
        bytes.extend((-70000i32).to_le_bytes());
        bytes.extend(70000u32.to_le_bytes());
        bytes.extend(1.5f32.to_le_bytes());
        bytes.extend(2.5f64.to_le_bytes());
        bytes.extend([3, 1, 2, 3]);
        let table = read_from(Path::new("a.ply"), bytes.as_slice(), bytes.len() as u64).unwrap();
        assert_eq!(table.values, [-3.0, 200.0, -300.0, 60000.0, -70000.0, 70000.0, 1.5, 2.5]);
        assert_eq!((table.rows(), table.properties().len()), (1, 8));
    }

    #[test]
    fn hostile_headers_are_errors_and_take_no_memory() {
        let head = "ply\nformat binary_little_endian 1.0\n";
        for count in ["18446744073709551615", "4000000000", "2"] {
            let text = format!("{head}element vertex {count}\nproperty float x\nend_header\nabcd");
            assert!(message(&text).contains("promises"), "{count}");
        }
        let cases = [
            ("", "end_header"),
            ("plx\n", "begin with"),
            ("ply\nformat binary_big_endian 1.0\n", "big_endian"),
            ("ply\nformat ascii 1.0\nelement vertex -1\n", "not a number"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nend_header\n", "no properties"),
            ("ply\nformat ascii 1.0\nend_header\n", "no `element vertex`"),
            ("ply\nelement vertex 1\nproperty float x\nend_header\n1\n", "no `format`"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n", "end_header"),
            ("ply\nformat ascii 1.0\nelement face 1\n", "end_header"),
            ("ply\nformat ascii 1.0\nelement face x\n", "not a number"),
            ("ply\nformat ascii 1.0\nelement face 1\nproperty list uchar x\n", "not understood"),
            ("ply\nformat ascii 1.0\nelement face 1\nproperty quad x\n", "not known"),
            ("ply\nformat ascii 1.0\nproperty float x\n", "not understood"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nelement vertex 1\n", "twice"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\n", "twice"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\n", "list"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\n", "not known"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\nabc\n", "not a number"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1 2\n", "2 values"),
            ("ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n1\n\n", "0 values"),
        ];
        for (text, expected) in cases {
            let found = message(text);
            assert!(found.contains(expected) && found.contains("a.ply"), "{text:?}: {found}");
        }
        let long = format!("ply\ncomment {}\n", "x".repeat(1 << 20));
        assert!(message(&long).contains("longer than"));
        let many = format!("ply\n{}", "comment x\n".repeat(1 << 16));
        assert!(message(&many).contains("longer than"));
        let wide = format!(
            "{head}element vertex 1\n{}",
            (0..2000).map(|i| format!("property char p{i}\n")).collect::<String>()
        );
        assert!(message(&wide).contains("more than 1024"));
    }

    #[test]
    fn elements_before_the_vertices_are_passed_over() {
        let head = |encoding: &str, rows: &str| {
            format!(
                "ply\nformat {encoding} 1.0\nelement camera {rows}\nproperty double view\nproperty uchar id\n\
                 element face 2\nproperty list uchar int corners\nproperty list uint uchar tags\n\
                 element nothing 18446744073709551615\nelement vertex 1\nproperty float x\nend_header\n"
            )
        };
        let mut bytes = head("binary_little_endian", "2").into_bytes();
        bytes.extend([9; 18]);
        bytes.extend([2, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0]);
        bytes.extend([0, 3, 0, 0, 0, 5, 6, 7]);
        bytes.extend(1.5f32.to_le_bytes());
        let read = |bytes: &[u8]| read_from(Path::new("a.ply"), bytes, bytes.len() as u64);
        assert_eq!(read(&bytes).unwrap().values, [1.5]);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length}");
        }
        let text = |rows: &str| format!("{}0.5 1\n0.5 2\n2 1 2 0\n0 3 5 6 7\n1.5\n", head("ascii", rows));
        assert_eq!(parse(&text("2")).unwrap().values, [1.5]);
        assert!(message(&text("18446744073709551615")).contains("rows of `camera`, the file holds 5"));
        let lengths = "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list char int x\n\
                       element vertex 1\nproperty float x\nend_header\n";
        let negative = [lengths.as_bytes(), &[0xff; 9]].concat();
        assert!(read(&negative).unwrap_err().to_string().contains("no whole number"));
    }

    #[test]
    fn a_compressed_file_is_called_by_its_name() {
        let text = "ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\nelement vertex 1\n\
                    property uint packed_position\nproperty uint packed_rotation\nend_header\n";
        let found = message(text);
        assert!(found.contains("compressed PLY") && found.contains("splat-transform"), "{found}");
    }

    #[test]
    fn any_truncation_is_an_error_not_a_panic() {
        let mut bytes =
            b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty uchar y\nend_header\n"
                .to_vec();
        bytes.extend([7; 15]);
        for length in 0..=bytes.len() {
            let result = read_from(Path::new("a.ply"), &bytes[..length], length as u64);
            assert_eq!(result.is_ok(), length == bytes.len(), "{length}");
        }
    }
}
