//! The golden streams of control nodes, damaged field by field: an error names the field, and an accepted stream can be
//! played.

use light4gs_codec::{MotionEvaluator, decode};
use light4gs_hostile::{
    parts::{Parts, varint},
    watch::{CountingAllocator, Decoder},
};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const CODED: &[u8] = include_bytes!("../../../golden-streams/nodes.l4gs");
const FLOAT32: &[u8] = include_bytes!("../../../golden-streams/nodes.decoded.l4gs");
const LIFETIMES: &[u8] = include_bytes!("../../../golden-streams/lifetimes.l4gs");
/// The number of the section.
const MOTION: u16 = 4;

/// How a field is written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Byte,
    Varint,
    Float,
    /// Several bytes, of which only the first is damaged.
    Text,
}

/// A field of the description, by the words that an error has about a number that no such field may have.
#[derive(Debug)]
struct Field {
    words: &'static str,
    form: Form,
    start: usize,
    end: usize,
}

/// Walks over a description, by docs/format.md alone.
struct Walk<'a> {
    bytes: &'a [u8],
    fields: Vec<Field>,
}

impl Walk<'_> {
    fn at(&self) -> usize {
        self.fields.last().map_or(0, |field| field.end)
    }

    fn take(&mut self, words: &'static str, form: Form) -> u64 {
        let start = self.at();
        let length = match form {
            Form::Byte | Form::Text => 1,
            Form::Float => 4,
            Form::Varint => self.bytes[start..].iter().take_while(|byte| **byte >= 0x80).count() + 1,
        };
        self.fields.push(Field { words, form, start, end: start + length });
        self.bytes[start..start + length].iter().rev().fold(0, |value, byte| (value << 7) | u64::from(byte & 0x7f))
    }

    fn number(&mut self, words: &'static str) -> u64 {
        self.take(words, Form::Varint)
    }

    fn text(&mut self, length: &'static str, words: &'static str) {
        let length = self.number(length) as usize;
        let start = self.at();
        self.fields.push(Field { words, form: Form::Text, start, end: start + length });
    }

    fn node(&mut self) {
        let start = self.at();
        self.take("operation of the network, node", Form::Byte);
        let (code, reads_last) = (self.bytes[start] & 0x7f, self.bytes[start] & 0x80 != 0);
        let inputs = match code {
            13 => self.number("inputs of a concatenation"),
            14..=17 => 2,
            _ => 1,
        };
        for _ in u64::from(reads_last)..inputs {
            self.number("an input of the network, node");
        }
        match code {
            0 => {
                self.number("outputs of a layer");
            }
            21 => {
                self.take("scale of an affine operation", Form::Float);
                self.take("offset of an affine operation", Form::Float);
            }
            23 | 24 => {
                self.number("channels of a group");
            }
            25 => {
                for _ in 0..self.number("runs of selected channels") {
                    self.number("a selected channel");
                    self.number("length of a run of selected channels");
                }
            }
            5 | 13..=20 => {}
            other => panic!("no network of nodes has an operation {other}"),
        }
    }

    /// Everything before the weights.
    fn description(&mut self) {
        self.text("length of kind", "kind");
        self.take("presence of a network", Form::Byte);
        let inputs = self.number("number of a network's inputs");
        for _ in 0..inputs {
            self.number("channels of an input");
        }
        let nodes = self.number("number of a network's nodes");
        (0..nodes).for_each(|_| self.node());
        let outputs = self.number("number of a network's outputs");
        for _ in 0..outputs {
            self.number("an output");
        }
        for _ in 0..inputs {
            if self.take("a source of the network", Form::Byte) == 3 {
                self.text("length of name of an attribute", "name of an attribute");
            }
        }
        for _ in 0..outputs {
            self.take("an output of the network", Form::Byte);
        }
        self.number("number of tensors");
    }
}

fn fields(payload: &[u8]) -> Vec<Field> {
    let mut walk = Walk { bytes: payload, fields: Vec::new() };
    walk.description();
    walk.fields
}

/// Numbers at the ends of types and limits, small ones, and those that are no numbers.
fn damage(form: Form) -> Vec<Vec<u8>> {
    let floats = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -0.0, 1e-45, 1e30];
    let numbers = [0, 1, 2, 3, 5, 64, 255, 256, 257, 4096, 65_536, 65_537, 1 << 17, 1 << 20, 1 << 31];
    match form {
        Form::Byte | Form::Text => [0u8, 1, 2, 4, 9, 26, 0x7f, 0x80, 0x8d, 0x99, 0xff].map(|byte| vec![byte]).to_vec(),
        Form::Float => floats.map(|number| number.to_le_bytes().to_vec()).to_vec(),
        Form::Varint => numbers.into_iter().chain([u32::MAX.into(), u64::MAX]).map(varint).collect(),
    }
}

/// Values that no field of a form may hold.
fn absurd(form: Form) -> Vec<u8> {
    match form {
        Form::Byte => vec![0x7f],
        Form::Text => vec![0xff],
        Form::Varint => varint(u32::MAX.into()),
        Form::Float => f32::NAN.to_le_bytes().to_vec(),
    }
}

fn with(parts: &Parts, field: &Field, new: &[u8]) -> Vec<u8> {
    let mut parts = parts.clone();
    let payload = &mut parts.section(MOTION).expect("a motion").payload;
    let end = if field.form == Form::Text { field.start + 1 } else { field.end };
    payload.splice(field.start..end, new.iter().copied());
    parts.assemble()
}

/// The error of a stream; none if it can be played.
fn error(decoder: &Decoder, bytes: &[u8], what: &dyn std::fmt::Debug) -> Option<String> {
    let outcome = decoder.run(bytes);
    assert!(outcome.fault().is_none() && outcome.bytes < 32 << 20, "{what:?}: {outcome:?}");
    let error = outcome.answer.and_then(Result::err).map(|error| error.to_string());
    if error.is_none() {
        let scene = decode(bytes).expect("decoded above");
        let mut moved = scene.gaussians.clone();
        if let Ok(evaluator) = MotionEvaluator::new(&scene) {
            evaluator.apply(&scene.gaussians, 0.4, 0..moved.len(), &mut moved);
        }
    }
    error
}

#[test]
fn every_field_that_lies_is_named() {
    let decoder = Decoder::on_this_thread();
    for bytes in [CODED, FLOAT32, LIFETIMES] {
        let mut parts = Parts::of(bytes);
        let fields = fields(&parts.section(MOTION).expect("a motion").payload);
        assert!(fields.len() > 300, "{} fields", fields.len());
        let (mut refused, mut played) = (0, 0);
        for field in &fields {
            let message = error(&decoder, &with(&parts, field, &absurd(field.form)), field).expect("refused");
            assert!(message.starts_with("motion: ") && message.contains(field.words), "{field:?}: {message}");
            for new in damage(field.form) {
                match error(&decoder, &with(&parts, field, &new), &(field, &new)) {
                    Some(message) => {
                        assert!(message.starts_with("motion: "), "{field:?} {new:?}: {message}");
                        refused += 1;
                    }
                    None => played += 1,
                }
            }
        }
        assert!(refused > 2000 && played > 100, "{refused} refused, {played} played");
    }
}

/// Anchors, knots and radii that are no numbers, too few of them and too many.
#[test]
fn numbers_that_are_none_are_named() {
    let decoder = Decoder::on_this_thread();
    let mut parts = Parts::of(FLOAT32);
    let payload = parts.section(MOTION).expect("a motion").payload.clone();
    let weights = fields(&payload).last().expect("fields").end;
    let field = |at: usize| Field { words: "weight or bias", form: Form::Float, start: at, end: at + 4 };
    let count = (payload.len() - weights) / 4;
    for index in (0..count).step_by(7) {
        for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let new = number.to_le_bytes();
            let message = error(&decoder, &with(&parts, &field(weights + 4 * index), &new), &index).expect("refused");
            assert!(message.starts_with("motion: ") && message.contains("layers["), "{message}");
        }
    }
    for (start, new) in [(payload.len() - 4, vec![]), (payload.len() - 4, vec![0; 8])] {
        let message = error(&decoder, &with(&parts, &field(start), &new), &start).expect("refused");
        assert!(message.starts_with("motion: "), "{message}");
    }
    let mut coded = Parts::of(CODED);
    let payload = coded.section(MOTION).expect("a motion").payload.clone();
    for length in weights..payload.len() {
        coded.section(MOTION).expect("a motion").payload.truncate(length);
        if let Some(message) = error(&decoder, &coded.assemble(), &length) {
            assert!(message.starts_with("motion: "), "{message}");
        }
        coded.section(MOTION).expect("a motion").payload = payload.clone();
    }
}
