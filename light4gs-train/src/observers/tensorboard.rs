//! Event files for TensorBoard: scalars over the iterations of a run.
//!
//! The crate `tensorboard-rs` is unmaintained, and the format is small: a file is a sequence of TFRecords (length, its
//! checksum, bytes, their checksum), each a protobuf `Event` of a few fields, which are encoded here.
//!
//! Each session of a run writes a file of its own, as TensorBoard expects. A session that resumes writes the step from
//! which it does, and TensorBoard then hides the data of earlier files from that step on.

use std::fs::{self, File, OpenOptions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use light4gs_data::DataError;

use super::Observer;
use super::metrics_log::MetricsRecord;
use crate::config::TrainConfig;
use crate::error::TrainError;

/// Writes one event file.
#[derive(Debug)]
pub struct TensorBoard {
    path: PathBuf,
    out: BufWriter<File>,
}

impl TensorBoard {
    /// Makes a new event file in `folder`, which is made if it does not exist. `resume_step` is the first step that
    /// this session writes, if an earlier session may have written it already.
    ///
    /// # Errors
    /// [`DataError::Io`] naming the file.
    pub fn create(folder: &Path, resume_step: Option<u64>) -> Result<Self, DataError> {
        fs::create_dir_all(folder).map_err(failed("create", folder))?;
        let (path, file) = new_file(folder)?;
        let mut writer = Self { path, out: BufWriter::new(file) };
        writer.record(&Event { text_version: Some("brain.Event:2"), ..Event::now(0) })?;
        if let Some(step) = resume_step {
            writer.record(&Event { session_start: true, ..Event::now(step) })?;
        }
        writer.flush()?;
        Ok(writer)
    }

    /// The event file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes values by tag (`loss/total`; the part before the slash groups them) and passes them to the system.
    ///
    /// # Errors
    /// [`DataError::Io`] naming the file.
    pub fn scalars(&mut self, step: u64, values: &[(&str, f32)]) -> Result<(), DataError> {
        self.record(&Event { scalars: values, ..Event::now(step) })?;
        self.flush()
    }

    fn record(&mut self, event: &Event) -> Result<(), DataError> {
        self.out.write_all(&framed(&event.encode())).map_err(failed("write", &self.path))
    }

    fn flush(&mut self) -> Result<(), DataError> {
        self.out.flush().map_err(failed("write", &self.path))
    }
}

/// The metrics of a run as an event file. Steps are iterations over both stages.
#[derive(Debug)]
pub struct TensorBoardLog {
    events: TensorBoard,
    train: TrainConfig,
}

impl TensorBoardLog {
    /// As [`TensorBoard::create`], for a run of this configuration.
    ///
    /// # Errors
    /// [`DataError::Io`] naming the file.
    pub fn create(folder: &Path, resume_step: Option<u64>, train: &TrainConfig) -> Result<Self, DataError> {
        Ok(Self { events: TensorBoard::create(folder, resume_step)?, train: train.clone() })
    }
}

impl Observer for TensorBoardLog {
    fn on_log(&mut self, record: &MetricsRecord) -> Result<(), TrainError> {
        let step = self.train.global_step(record.stage, record.iteration) as u64;
        let mut scalars = vec![("gaussians", record.gaussians as f32)];
        let optional = [
            ("loss", record.loss),
            ("psnr/train", record.psnr),
            ("psnr/test", record.test_psnr),
            ("iterations_per_second", record.iterations_per_second),
        ];
        scalars.extend(optional.into_iter().filter_map(|(name, value)| Some((name, value? as f32))));
        Ok(self.events.scalars(step, &scalars)?)
    }
}

/// `events.out.tfevents.<seconds>.<host>.<n>`: TensorBoard reads the files of a folder in the order of their names.
fn new_file(folder: &Path) -> Result<(PathBuf, File), DataError> {
    let seconds = wall_time() as u64;
    let host = host();
    let mut number = 0;
    loop {
        let path = folder.join(format!("events.out.tfevents.{seconds:010}.{host}.{number}"));
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Ok(file) => return Ok((path, file)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => number += 1,
            Err(error) => return Err(failed("create", &path)(error)),
        }
    }
}

fn host() -> String {
    let name = fs::read_to_string("/proc/sys/kernel/hostname")
        .ok()
        .or_else(|| std::env::var("HOSTNAME").ok())
        .or_else(|| std::env::var("COMPUTERNAME").ok())
        .unwrap_or_default();
    let name: String = name.trim().chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').collect();
    if name.is_empty() { "localhost".to_owned() } else { name }
}

fn wall_time() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map(|since| since.as_secs_f64()).unwrap_or(0.0)
}

/// The fields of TensorFlow's `Event` that we use.
#[derive(Default)]
struct Event<'a> {
    wall_time: f64,
    step: u64,
    text_version: Option<&'a str>,
    scalars: &'a [(&'a str, f32)],
    session_start: bool,
}

impl Event<'_> {
    fn now(step: u64) -> Self {
        Self { wall_time: wall_time(), step, ..Self::default() }
    }

    fn encode(&self) -> Vec<u8> {
        let mut message = Vec::new();
        put_key(&mut message, 1, WireType::Fixed64);
        message.extend(self.wall_time.to_le_bytes());
        put_key(&mut message, 2, WireType::Varint);
        put_varint(&mut message, self.step);
        if let Some(version) = self.text_version {
            put_bytes(&mut message, 3, version.as_bytes());
        }
        if !self.scalars.is_empty() {
            let mut summary = Vec::new();
            for (tag, value) in self.scalars {
                let mut entry = Vec::new();
                put_bytes(&mut entry, 1, tag.as_bytes());
                put_key(&mut entry, 2, WireType::Fixed32);
                entry.extend(value.to_le_bytes());
                put_bytes(&mut summary, 1, &entry);
            }
            put_bytes(&mut message, 5, &summary);
        }
        if self.session_start {
            // SessionLog { status: START }
            put_bytes(&mut message, 7, &[0x08, 0x01]);
        }
        message
    }
}

/// How a protobuf field is stored.
#[derive(Clone, Copy)]
enum WireType {
    Varint = 0,
    Fixed64 = 1,
    Bytes = 2,
    Fixed32 = 5,
}

fn put_key(message: &mut Vec<u8>, field: u64, wire_type: WireType) {
    put_varint(message, field << 3 | wire_type as u64);
}

fn put_bytes(message: &mut Vec<u8>, field: u64, bytes: &[u8]) {
    put_key(message, field, WireType::Bytes);
    put_varint(message, bytes.len() as u64);
    message.extend(bytes);
}

/// Seven bits in each byte, the lowest first; the top bit is set where more follow.
fn put_varint(message: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

/// A TFRecord.
fn framed(message: &[u8]) -> Vec<u8> {
    let length = (message.len() as u64).to_le_bytes();
    let mut record = Vec::with_capacity(message.len() + 16);
    record.extend(length);
    record.extend(masked_checksum(&length).to_le_bytes());
    record.extend(message);
    record.extend(masked_checksum(message).to_le_bytes());
    record
}

/// CRC-32C, rotated and shifted as TFRecord requires, so that data which contains checksums has a good checksum too.
fn masked_checksum(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

fn failed(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> DataError {
    let path = path.to_path_buf();
    move |source| DataError::Io { action, path, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A field of a message: its number, then the bits of a number, or bytes.
    #[derive(Debug, PartialEq)]
    enum Field<'a> {
        Number(u64, u64),
        Bytes(u64, &'a [u8]),
    }

    fn take<'a>(bytes: &mut &'a [u8], count: usize) -> &'a [u8] {
        let (head, tail) = bytes.split_at(count);
        *bytes = tail;
        head
    }

    fn take_varint(bytes: &mut &[u8]) -> u64 {
        let mut value = 0;
        for shift in (0..).step_by(7) {
            let byte = take(bytes, 1)[0];
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                break;
            }
        }
        value
    }

    fn fields(mut message: &[u8]) -> Vec<Field<'_>> {
        let mut fields = Vec::new();
        while !message.is_empty() {
            let key = take_varint(&mut message);
            let number = key >> 3;
            fields.push(match key & 7 {
                0 => Field::Number(number, take_varint(&mut message)),
                1 => Field::Number(number, u64::from_le_bytes(take(&mut message, 8).try_into().expect("8 bytes"))),
                2 => {
                    let length = take_varint(&mut message) as usize;
                    Field::Bytes(number, take(&mut message, length))
                }
                5 => {
                    Field::Number(number, u32::from_le_bytes(take(&mut message, 4).try_into().expect("4 bytes")).into())
                }
                other => panic!("wire type {other}"),
            });
        }
        fields
    }

    fn records(mut file: &[u8]) -> Vec<&[u8]> {
        let mut records = Vec::new();
        while !file.is_empty() {
            let length = take(&mut file, 8);
            assert_eq!(take(&mut file, 4), masked_checksum(length).to_le_bytes());
            let message = take(&mut file, u64::from_le_bytes(length.try_into().expect("8 bytes")) as usize);
            assert_eq!(take(&mut file, 4), masked_checksum(message).to_le_bytes());
            records.push(message);
        }
        records
    }

    #[test]
    fn a_file_reads_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut board = TensorBoard::create(folder.path(), Some(300)).expect("a writer");
        board.scalars(300, &[("loss/total", 0.5), ("psnr", 31.25)]).expect("an event");
        let file = fs::read(board.path()).expect("bytes");
        let records = records(&file);
        assert_eq!(records.len(), 3);
        assert!(fields(records[0]).contains(&Field::Bytes(3, b"brain.Event:2")));
        assert_eq!(&fields(records[1])[1..], [Field::Number(2, 300), Field::Bytes(7, &[8, 1])]);
        let event = fields(records[2]);
        assert!(matches!(event[0], Field::Number(1, bits) if f64::from_bits(bits) > 1e9));
        assert_eq!(event[1], Field::Number(2, 300));
        let Field::Bytes(5, summary) = event[2] else { panic!("a summary") };
        let values: Vec<_> = fields(summary);
        let Field::Bytes(1, first) = values[0] else { panic!("a value") };
        assert_eq!(fields(first), [Field::Bytes(1, b"loss/total"), Field::Number(2, 0.5_f32.to_bits().into())]);
        assert_eq!(values.len(), 2);
    }

    #[test]
    fn each_session_has_a_file_of_its_own() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = TensorBoard::create(folder.path(), None).expect("a writer");
        let second = TensorBoard::create(folder.path(), Some(7)).expect("a writer");
        assert_ne!(first.path(), second.path());
        let mut names = [first.path(), second.path()];
        names.sort();
        assert_eq!(names, [first.path(), second.path()]);
    }

    #[test]
    fn the_checksum_is_crc_32c() {
        // RFC 3720, B.4: 32 bytes of zeros.
        assert_eq!(crc32c::crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(masked_checksum(&[0; 32]), 0x8a91_36aa_u32.rotate_right(15).wrapping_add(0xa282_ead8));
    }
}
