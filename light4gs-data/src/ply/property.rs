//! Columns of a vertex table: names, types, and how their numbers are stored.

/// How numbers are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Text, one vertex a line.
    Ascii,
    /// Packed little endian.
    BinaryLittleEndian,
}

/// The scalar types of PLY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// `char`, `int8`
    I8,
    /// `uchar`, `uint8`
    U8,
    /// `short`, `int16`
    I16,
    /// `ushort`, `uint16`
    U16,
    /// `int`, `int32`
    I32,
    /// `uint`, `uint32`
    U32,
    /// `float`, `float32`
    F32,
    /// `double`, `float64`
    F64,
}

impl Scalar {
    pub(super) fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::I8 => "char",
            Self::U8 => "uchar",
            Self::I16 => "short",
            Self::U16 => "ushort",
            Self::I32 => "int",
            Self::U32 => "uint",
            Self::F32 => "float",
            Self::F64 => "double",
        }
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The largest value of an integer type; 1 for floats.
    pub(super) fn unit(self) -> f32 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::I32 => 2_147_483_647.0,
            Self::U32 => 4_294_967_295.0,
            Self::F32 | Self::F64 => 1.0,
        }
    }

    /// `b` has at least `self.size()` bytes.
    pub(super) fn decode(self, b: &[u8]) -> f32 {
        match self {
            Self::I8 => f32::from(b[0] as i8),
            Self::U8 => f32::from(b[0]),
            Self::I16 => f32::from(i16::from_le_bytes([b[0], b[1]])),
            Self::U16 => f32::from(u16::from_le_bytes([b[0], b[1]])),
            Self::I32 => i32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            Self::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
            Self::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            Self::F64 => f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f32,
        }
    }

    /// A length; none if it is no whole number from 0. `b` has at least `self.size()` bytes.
    pub(super) fn decode_length(self, b: &[u8]) -> Option<u64> {
        match self {
            Self::U32 => Some(u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            Self::I32 => u64::try_from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])).ok(),
            Self::F32 | Self::F64 => None,
            // These fit into a float32 exactly.
            _ => Some(self.decode(b)).filter(|length| *length >= 0.0).map(|length| length as u64),
        }
    }

    pub(super) fn encode(self, value: f32, out: &mut Vec<u8>) {
        match self {
            Self::I8 => out.extend((value as i8).to_le_bytes()),
            Self::U8 => out.push(value as u8),
            Self::I16 => out.extend((value as i16).to_le_bytes()),
            Self::U16 => out.extend((value as u16).to_le_bytes()),
            Self::I32 => out.extend((value as i32).to_le_bytes()),
            Self::U32 => out.extend((value as u32).to_le_bytes()),
            Self::F32 => out.extend(value.to_le_bytes()),
            Self::F64 => out.extend(f64::from(value).to_le_bytes()),
        }
    }
}

/// A named column of the vertex table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Property {
    /// Its name, without white space.
    pub name: String,
    /// Its type on disk.
    pub scalar: Scalar,
}

impl Property {
    /// A column.
    pub fn new(name: impl Into<String>, scalar: Scalar) -> Self {
        Self { name: name.into(), scalar }
    }
}
