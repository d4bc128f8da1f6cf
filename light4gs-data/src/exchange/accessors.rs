//! The numbers of a glTF file: one buffer, a view of it for each list, and an accessor for each view.

use serde_json::{Value, json};

/// The purpose of a view's numbers, which glTF wants to know: attributes of vertices.
pub(super) const VERTICES: Option<u32> = Some(34962);
/// Anything else.
pub(super) const OTHER: Option<u32> = None;

/// A type of glTF's numbers.
pub(super) trait Component: Copy {
    /// Its number in glTF.
    const CODE: u32;

    fn write(self, bytes: &mut Vec<u8>);

    fn is_finite(self) -> bool {
        true
    }
}

impl Component for u8 {
    const CODE: u32 = 5121;

    fn write(self, bytes: &mut Vec<u8>) {
        bytes.push(self);
    }
}

impl Component for u16 {
    const CODE: u32 = 5123;

    fn write(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

impl Component for f32 {
    const CODE: u32 = 5126;

    fn write(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }

    fn is_finite(self) -> bool {
        self.is_finite()
    }
}

/// Lists of numbers, one after the other in one buffer.
#[derive(Default)]
pub(super) struct Accessors {
    pub(super) bytes: Vec<u8>,
    pub(super) views: Vec<Value>,
    pub(super) list: Vec<Value>,
    /// Whether a number is NaN or infinite.
    pub(super) not_finite: bool,
}

impl Accessors {
    /// Adds a list whose rows have a multiple of 4 bytes, and returns the number of its accessor.
    pub(super) fn add<T: Component, const N: usize>(
        &mut self,
        rows: impl Iterator<Item = [T; N]>,
        target: Option<u32>,
    ) -> usize {
        let (begin, mut count) = (self.bytes.len(), 0);
        for row in rows {
            for value in row {
                self.not_finite |= !value.is_finite();
                value.write(&mut self.bytes);
            }
            count += 1;
        }
        let kind = match N {
            1 => "SCALAR",
            16 => "MAT4",
            _ => ["VEC2", "VEC3", "VEC4"][N - 2],
        };
        let mut view = json!({"buffer": 0, "byteOffset": begin, "byteLength": self.bytes.len() - begin});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.list.push(json!({"bufferView": self.views.len(), "componentType": T::CODE, "count": count, "type": kind}));
        self.views.push(view);
        self.list.len() - 1
    }

    /// The same, with the least and the largest number of each column.
    pub(super) fn add_bounded<const N: usize>(
        &mut self,
        rows: impl Iterator<Item = [f32; N]>,
        target: Option<u32>,
    ) -> usize {
        let (mut low, mut high) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
        let rows = rows.inspect(|row| {
            for (axis, value) in row.iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(*value), high[axis].max(*value));
            }
        });
        let number = self.add(rows, target);
        self.list[number]["min"] = json!(low.to_vec());
        self.list[number]["max"] = json!(high.to_vec());
        number
    }
}
