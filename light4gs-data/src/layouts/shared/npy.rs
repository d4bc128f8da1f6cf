//! NumPy's `.npy` files: one array of numbers.

use crate::error::DataError;
use crate::regular_file::read_regular_file;
use std::path::Path;

/// Largest size in bytes. Poses and points have megabytes, so a larger file is neither.
const MAX_BYTES: u64 = 1 << 30;

/// A two-dimensional array, row-major.
#[derive(Debug, PartialEq)]
pub(in crate::layouts) struct Array2 {
    pub(in crate::layouts) rows: usize,
    pub(in crate::layouts) columns: usize,
    pub(in crate::layouts) values: Vec<f64>,
}

impl Array2 {
    pub(in crate::layouts) fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..(i + 1) * self.columns]
    }
}

/// Reads an array of shape `[N, columns]` of floating-point or whole numbers, either byte order, C or Fortran order.
/// `what` says what is in it, for messages.
///
/// # Errors
/// [`DataError::Field`] naming the part of the header that is not as expected, or the first number that is not finite.
pub(in crate::layouts) fn read(path: &Path, columns: usize, what: &str) -> Result<Array2, DataError> {
    let bytes = read_regular_file(path, MAX_BYTES).map_err(DataError::io("read", path))?;
    let bad = |field: &str, problem: String| {
        let remedy = format!("save it again with numpy.save as an array of {what}");
        DataError::field(path, field, problem, remedy)
    };
    let (header, data) =
        split(&bytes).ok_or_else(|| bad("header", "this is no .npy file, or it is truncated".into()))?;
    let field = |name: &str| value_of(header, name).ok_or_else(|| bad(name, "missing in the header".into()));
    let kind = field("descr")?.trim_matches(['\'', '"']);
    let number = Number::parse(kind).ok_or_else(|| {
        bad("descr", format!("`{}`, expected numbers such as <f4 or <f8", super::files::shorten(kind)))
    })?;
    let shape = field("shape")?;
    let sizes: Option<Vec<usize>> = shape
        .strip_prefix('(')
        .and_then(|rest| rest.strip_suffix(')'))
        .map(|inner| inner.split(',').map(str::trim).filter(|part| !part.is_empty()))
        .and_then(|parts| parts.map(|part| part.trim_end_matches('L').parse().ok()).collect());
    let rows = match sizes.as_deref() {
        Some(&[rows, found]) if found == columns && rows > 0 => rows,
        _ => {
            let shape = super::files::shorten(shape);
            return Err(bad("shape", format!("{shape}, expected (N, {columns}) with N of at least 1")));
        }
    };
    let fortran = match field("fortran_order")? {
        "True" => true,
        "False" => false,
        other => {
            return Err(bad("fortran_order", format!("`{}`, expected True or False", super::files::shorten(other))));
        }
    };
    let needed = rows.checked_mul(columns).and_then(|count| count.checked_mul(number.size));
    if needed != Some(data.len()) {
        let expected = needed.map_or_else(|| "more than any file".into(), |bytes| bytes.to_string());
        return Err(bad("data", format!("{} bytes follow the header, expected {expected}", data.len())));
    }
    let stored: Vec<f64> = data.chunks_exact(number.size).map(|bytes| number.decode(bytes)).collect();
    if let Some(i) = stored.iter().position(|v| !v.is_finite()) {
        let (row, column) = if fortran { (i % rows, i / rows) } else { (i / columns, i % columns) };
        return Err(bad(&format!("[{row}, {column}]"), format!("{}, expected a finite number", stored[i])));
    }
    let values = if fortran {
        (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))).map(|(r, c)| stored[c * rows + r]).collect()
    } else {
        stored
    };
    Ok(Array2 { rows, columns, values })
}

/// The header's text and the bytes after it.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let (major, rest) = (*rest.first()?, rest.get(2..)?);
    let (length, rest) = if major == 1 {
        let (length, rest) = rest.split_first_chunk::<2>()?;
        (u16::from_le_bytes(*length) as usize, rest)
    } else {
        let (length, rest) = rest.split_first_chunk::<4>()?;
        (u32::from_le_bytes(*length) as usize, rest)
    };
    let (header, data) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, data))
}

/// The value of a key in the header, which is a Python dictionary: `{'descr': '<f8', 'shape': (5, 17), }`.
fn value_of<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let after = ["'", "\""].iter().find_map(|quote| header.split_once(&format!("{quote}{key}{quote}")))?.1;
    let value = after.trim_start().strip_prefix(':')?.trim_start();
    let end = if value.starts_with('(') { value.find(')')? + 1 } else { value.find([',', '}'])? };
    Some(value[..end].trim())
}

/// How a number is stored.
struct Number {
    big_endian: bool,
    kind: char,
    size: usize,
}

impl Number {
    fn parse(text: &str) -> Option<Self> {
        let mut letters = text.chars();
        let order = letters.next()?;
        let kind = letters.next()?;
        let size = letters.as_str().parse().ok()?;
        let known = match kind {
            'f' => matches!(size, 4 | 8),
            'i' | 'u' => matches!(size, 1 | 2 | 4 | 8),
            _ => false,
        };
        (known && "<>|=".contains(order)).then_some(Self { big_endian: order == '>', kind, size })
    }

    fn decode(&self, bytes: &[u8]) -> f64 {
        let mut little = [0u8; 8];
        little[..self.size].copy_from_slice(bytes);
        if self.big_endian {
            little[..self.size].reverse();
        }
        let bits = u64::from_le_bytes(little);
        match (self.kind, self.size) {
            ('f', 4) => f64::from(f32::from_bits(bits as u32)),
            ('f', _) => f64::from_bits(bits),
            ('u', _) => bits as f64,
            // The sign is the highest stored bit.
            (_, size) => ((bits << (64 - 8 * size)) as i64 >> (64 - 8 * size)) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut out = b"\x93NUMPY\x01\x00".to_vec();
        out.extend((header.len() as u16).to_le_bytes());
        out.extend(header.as_bytes());
        out.extend(data);
        out
    }

    fn read_bytes(bytes: &[u8], columns: usize) -> Result<Array2, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        std::fs::write(&path, bytes).unwrap();
        read(&path, columns, "test").map_err(|e| e.to_string())
    }

    fn floats(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    #[test]
    fn types_and_orders() {
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }     \n";
        let array = read_bytes(&file(header, &floats(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0])), 3).unwrap();
        assert_eq!((array.rows, array.row(1)), (2, &[3.0, 4.0, 5.0][..]));
        let fortran = header.replace("False", "True");
        let same = read_bytes(&file(&fortran, &floats(&[0.0, 3.0, 1.0, 4.0, 2.0, 5.0])), 3).unwrap();
        assert_eq!(array, same);
        let big = "{\"shape\": (1, 2), \"descr\": \">f8\", \"fortran_order\": False}";
        let data: Vec<u8> = [1.5f64, -2.5].iter().flat_map(|v| v.to_be_bytes()).collect();
        assert_eq!(read_bytes(&file(big, &data), 2).unwrap().values, [1.5, -2.5]);
        let small = "{'descr': '|i1', 'fortran_order': False, 'shape': (1L, 2L)}";
        assert_eq!(read_bytes(&file(small, &[255, 7]), 2).unwrap().values, [-1.0, 7.0]);
    }

    #[test]
    fn every_bad_header_is_named() {
        let good = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }";
        let data = floats(&[0.0; 6]);
        let refuses = |bytes: &[u8], words: &[&str]| {
            let message = read_bytes(bytes, 3).unwrap_err();
            for word in words.iter().chain(&["a.npy", "numpy.save"]) {
                assert!(message.contains(word), "`{word}` is not in: {message}");
            }
        };
        refuses(b"hello", &["header"]);
        refuses(&file(good, &data)[..30], &["truncated"]);
        refuses(&file(&good.replace("<f4", "|O"), &data), &["descr", "|O"]);
        refuses(&file(&good.replace("<f4", "<c8"), &data), &["descr"]);
        refuses(&file(&good.replace("(2, 3)", "(3, 2)"), &data), &["shape", "(N, 3)"]);
        refuses(&file(&good.replace("(2, 3)", "(6,)"), &data), &["shape"]);
        refuses(&file(&good.replace("(2, 3)", "(0, 3)"), &[]), &["shape"]);
        refuses(&file(&good.replace("(2, 3)", "(9999999999999999999, 3)"), &data), &["data"]);
        refuses(&file(&good.replace("(2, 3)", "(99999999999999999999, 3)"), &data), &["shape"]);
        refuses(&file(&good.replace("(2, 3)", "(6148914691236517205, 3)"), &data), &["data"]);
        refuses(&file(&good.replace("False", "perhaps"), &data), &["fortran_order"]);
        refuses(&file(&good.replace("'shape'", "'size'"), &data), &["shape", "missing"]);
        refuses(&file(good, &data[..20]), &["data", "20 bytes", "24"]);
        refuses(&file(good, &floats(&[0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0])), &["[1, 1]", "NaN"]);
    }
}
