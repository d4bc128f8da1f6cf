//! TOML has no null: an absent optional whole number is written as 0, an absent optional word as an empty text. So a
//! written file is complete, and a file can undo what the one that it extends has set.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Writes a value, or the default of its type for none.
///
/// # Errors
/// Those of the serializer.
pub fn serialize<T, S>(value: &Option<T>, serializer: S) -> Result<S::Ok, S::Error>
where
    T: Serialize + Default + Clone,
    S: Serializer,
{
    value.clone().unwrap_or_default().serialize(serializer)
}

/// Reads a value, and takes the default of its type as none.
///
/// # Errors
/// Those of the deserializer: a value of another type.
pub fn deserialize<'de, T, D>(deserializer: D) -> Result<Option<T>, D::Error>
where
    T: Deserialize<'de> + Default + PartialEq,
    D: Deserializer<'de>,
{
    let value = T::deserialize(deserializer)?;
    Ok((value != T::default()).then_some(value))
}
