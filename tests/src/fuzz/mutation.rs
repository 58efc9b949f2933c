//! Changes of a file: of its bytes, of the numbers in its text, and of the values in its JSON.

use serde_json::{Value, json};

use super::chosen;
use crate::random::Random;

/// Longest file that changes make.
const LONGEST: usize = 1 << 18;

/// Integers at which readers break, as they stand in binary files.
const INTEGERS: [u64; 14] =
    [0, 1, 2, 0x7f, 0x80, 0xff, 0x7fff, 0xffff, 0x0001_0000, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 1 << 40, u64::MAX];

/// Numbers at which readers break, as they stand in text.
const NUMBERS: [&str; 20] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "255",
    "65535",
    "65536",
    "2147483647",
    "4294967295",
    "4294967296",
    "1099511627776",
    "9007199254740993",
    "18446744073709551615",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "nan",
    "inf",
];

/// The file after one change. `donor` is another file, parts of which it may get.
pub(super) fn mutated(name: &str, bytes: &[u8], donor: &[u8], random: &mut Random) -> Vec<u8> {
    let is_text = bytes.iter().take(400).filter(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()).count()
        >= bytes.len().min(400) * 3 / 4;
    let way = random.uniform();
    let changed = match name.rsplit('.').next() {
        Some("gltf") if way < 0.8 => of_json(bytes, random),
        Some("glb") if way < 0.7 => of_glb(bytes, random),
        _ if is_text && way < 0.7 => Some(of_text(bytes, random)),
        _ => None,
    };
    let mut changed = changed.unwrap_or_else(|| of_bytes(bytes, donor, random));
    changed.truncate(LONGEST);
    changed
}

/// A place in a file of this length, or its end.
fn place(length: usize, random: &mut Random) -> usize {
    (random.uniform() * (length + 1) as f64) as usize
}

fn of_bytes(bytes: &[u8], donor: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    // Headers matter most.
    let reach = if random.uniform() < 0.5 { bytes.len().min(128) } else { bytes.len() };
    let at = place(reach, random).min(bytes.len());
    let length = (place(16, random) * place(16, random)).min(bytes.len() - at);
    match (random.uniform() * 8.0) as u32 {
        0 if at < bytes.len() => bytes[at] ^= 1 << place(7, random),
        1 if at < bytes.len() => bytes[at] = (random.uniform() * 256.0) as u8,
        2 | 3 => {
            let width = *chosen(&[1, 2, 4, 8], random);
            let number = chosen(&INTEGERS, random).to_le_bytes();
            let mut number = number[..width].to_vec();
            if random.uniform() < 0.3 {
                number.reverse();
            }
            bytes.iter_mut().skip(at).zip(number).for_each(|(byte, new)| *byte = new);
        }
        4 => drop(bytes.drain(at..at + length)),
        5 => {
            let copy = bytes[at..at + length].to_vec();
            let times = 1 + place(3, random);
            bytes.splice(at..at, copy.repeat(times));
        }
        6 => bytes.truncate(at),
        _ => {
            let from = place(donor.len(), random).min(donor.len());
            let end = (from + place(256, random)).min(donor.len());
            bytes.splice(at..at + length, donor[from..end].iter().copied());
        }
    }
    bytes
}

/// Changes a line or a number of a text.
fn of_text(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut lines: Vec<Vec<u8>> = bytes.split_inclusive(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    if lines.is_empty() {
        return bytes.to_vec();
    }
    let at = place(lines.len() - 1, random).min(lines.len() - 1);
    match (random.uniform() * 8.0) as u32 {
        0 => drop(lines.remove(at)),
        1 => {
            let (line, times) = (lines[at].clone(), 1 + place(64, random));
            lines.splice(at..at, vec![line; times]);
        }
        2 => {
            let other = place(lines.len() - 1, random).min(lines.len() - 1);
            lines.swap(at, other);
        }
        3 => {
            let long = lines[at].repeat(1 + place(200, random));
            lines[at] = long.into_iter().filter(|byte| *byte != b'\n').collect();
        }
        _ => {
            let mut words: Vec<Vec<u8>> = lines[at].split(|byte| *byte == b' ').map(<[u8]>::to_vec).collect();
            let word = place(words.len() - 1, random).min(words.len() - 1);
            words[word] = chosen(&NUMBERS, random).as_bytes().to_vec();
            lines[at] = words.join(&b' ');
            lines[at].push(b'\n');
        }
    }
    lines.concat()
}

/// Changes a value of a JSON file.
fn of_json(bytes: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let mut root: Value = serde_json::from_slice(bytes).ok()?;
    let donor = root.clone();
    let places = places(&root);
    let place = chosen(&places, random);
    let changed = root.pointer_mut(place)?;
    match (random.uniform() * 8.0) as u32 {
        0..=2 => *changed = changed_value(changed, random),
        3 => *changed = donor.pointer(chosen::<String>(&places, random))?.clone(),
        4 => {
            if let Value::Array(elements) = changed {
                let more = vec![elements.clone(); 1 + self::place(6, random)].concat();
                elements.extend(more.into_iter().take(10_000));
            } else {
                *changed = json!([changed.clone()]);
            }
        }
        5 => {
            // The last of an object or array goes.
            match changed {
                Value::Array(elements) => drop(elements.pop()),
                Value::Object(members) => drop(members.keys().next_back().cloned().map(|key| members.remove(&key))),
                _ => *changed = Value::Null,
            }
        }
        _ => *changed = number(random),
    }
    serde_json::to_vec(&root).ok()
}

/// A value like another.
fn changed_value(value: &Value, random: &mut Random) -> Value {
    match value {
        Value::Number(old) => match old.as_i64() {
            // A neighbour: one too many is the fault that a check misses.
            Some(old) if random.uniform() < 0.5 => {
                json!(old.saturating_add(*chosen(&[-1, 1, 2, 3, 16, 1000], random)))
            }
            _ => number(random),
        },
        Value::String(text) => match (random.uniform() * 4.0) as u32 {
            0 => json!(format!("../../../../etc/{text}")),
            1 => json!(text.repeat(50)),
            2 => json!(text.chars().rev().collect::<String>()),
            _ => json!(""),
        },
        Value::Bool(value) => json!(!value),
        _ => Value::Null,
    }
}

fn number(random: &mut Random) -> Value {
    serde_json::from_str(chosen::<&str>(&NUMBERS, random)).unwrap_or(json!(1e300))
}

/// The places of all values below the root.
fn places(root: &Value) -> Vec<String> {
    let mut places = Vec::new();
    let mut open = vec![(String::new(), root)];
    while let Some((place, value)) = open.pop() {
        match value {
            Value::Array(elements) => {
                open.extend(elements.iter().enumerate().map(|(index, value)| (format!("{place}/{index}"), value)));
            }
            Value::Object(members) => {
                let escaped = |name: &str| name.replace('~', "~0").replace('/', "~1");
                open.extend(members.iter().map(|(name, value)| (format!("{place}/{}", escaped(name)), value)));
            }
            _ => {}
        }
        places.push(place);
    }
    places
}

/// Changes the JSON of a GLB file, and makes its lengths right again.
fn of_glb(bytes: &[u8], random: &mut Random) -> Option<Vec<u8>> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let length = word(12)?;
    let mut text = of_json(bytes.get(20..20_usize.checked_add(length)?)?, random)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + length..];
    let mut made = bytes[..8].to_vec();
    made.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
    made.extend((text.len() as u32).to_le_bytes());
    made.extend(&bytes[16..20]);
    made.extend(text);
    made.extend(rest);
    Some(made)
}
