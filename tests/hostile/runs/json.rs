//! Damage to JSON after which it is still JSON.

use rand::Rng;
use rand::seq::IndexedRandom;
use serde_json::{Map, Value, json};

/// Values that no field expects, or that are at the end of what fits.
fn odd_value(random: &mut impl Rng) -> Value {
    let values = [
        json!(null),
        json!(true),
        json!(-1),
        json!(0),
        json!(1e308),
        json!(-1e-308),
        json!(3.5e38),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(""),
        json!("\u{1b}[2J\u{202e}"),
        json!("../../../etc/passwd"),
        json!("x".repeat(5000)),
        json!([]),
        json!([[[[[[[[]]]]]]]]),
        json!({}),
        json!({"a": {"b": 1}}),
        json!([1, "2", null]),
    ];
    values.choose(random).expect("some").clone()
}

/// Changes one place of a value, and says which place and how.
pub fn mutate(value: &Value, random: &mut impl Rng) -> (Value, String) {
    let mut places = Vec::new();
    collect(value, String::new(), &mut places);
    let place = places.choose(random).expect("at least the root").clone();
    let mut out = value.clone();
    let target = out.pointer_mut(&place).expect("a place of it");
    let what = match (random.random_range(0..4), &mut *target) {
        (0, Value::Object(map)) if !map.is_empty() => {
            let key = map.keys().nth(random.random_range(0..map.len())).expect("a key").clone();
            map.remove(&key);
            format!("`{key}` removed")
        }
        (0, Value::Array(list)) if !list.is_empty() => {
            let at = random.random_range(0..list.len());
            list.remove(at);
            format!("element {at} removed")
        }
        (1, Value::Array(list)) if !list.is_empty() => {
            let copy = list.choose(random).expect("some").clone();
            list.push(copy);
            "an element doubled".to_owned()
        }
        (1, Value::Object(map)) => {
            map.insert("surprise".to_owned(), Value::Object(Map::new()));
            "a key added".to_owned()
        }
        (2, Value::Number(number)) => {
            let factor = *[-1.0, 0.0, 1e-30, 1e30, 2.0, 1.000_001].choose(random).expect("some");
            let changed = number.as_f64().unwrap_or(1.0) * factor;
            *target = json!(changed);
            format!("{changed} in its place")
        }
        _ => {
            let odd = odd_value(random);
            let shown: String = odd.to_string().chars().take(40).collect();
            *target = odd;
            format!("{shown} in its place")
        }
    };
    (out, format!("at `{place}`: {what}"))
}

/// JSON pointers to every place.
fn collect(value: &Value, place: String, into: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(key, inner)| {
            collect(inner, format!("{place}/{}", key.replace('~', "~0").replace('/', "~1")), into);
        }),
        // A few of many: the others would test the same.
        Value::Array(list) => list.iter().enumerate().take(6).for_each(|(i, inner)| {
            collect(inner, format!("{place}/{i}"), into);
        }),
        _ => {}
    }
    into.push(place);
}
