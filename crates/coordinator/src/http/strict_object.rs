//! JSON with one meaning for every reader: an object, in which no object names a member twice.

use std::collections::BTreeSet;
use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

/// Such an object, of which nothing is kept.
pub(super) struct StrictObject;

impl<'de> Deserialize<'de> for StrictObject {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ObjectVisitor;

        impl<'de> Visitor<'de> for ObjectVisitor {
            type Value = StrictObject;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a JSON object")
            }

            fn visit_map<A: MapAccess<'de>>(self, members: A) -> Result<StrictObject, A::Error> {
                AnyVisitor.visit_map(members).map(|_| StrictObject)
            }
        }

        deserializer.deserialize_any(ObjectVisitor)
    }
}

/// Any JSON value in which no object names a member twice.
struct StrictValue;

impl<'de> Deserialize<'de> for StrictValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(AnyVisitor)
    }
}

struct AnyVisitor;

impl<'de> Visitor<'de> for AnyVisitor {
    type Value = StrictValue;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("JSON")
    }

    fn visit_unit<E>(self) -> Result<StrictValue, E> {
        Ok(StrictValue)
    }

    fn visit_bool<E>(self, _: bool) -> Result<StrictValue, E> {
        Ok(StrictValue)
    }

    fn visit_i64<E>(self, _: i64) -> Result<StrictValue, E> {
        Ok(StrictValue)
    }

    fn visit_u64<E>(self, _: u64) -> Result<StrictValue, E> {
        Ok(StrictValue)
    }

    fn visit_f64<E>(self, _: f64) -> Result<StrictValue, E> {
        Ok(StrictValue)
    }

    fn visit_str<E>(self, _: &str) -> Result<StrictValue, E> {
        Ok(StrictValue)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<StrictValue, A::Error> {
        while elements.next_element::<StrictValue>()?.is_some() {}
        Ok(StrictValue)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<StrictValue, A::Error> {
        let mut names = BTreeSet::new();
        while let Some(name) = members.next_key::<String>()? {
            members.next_value::<StrictValue>()?;
            if let Some(name) = names.replace(name) {
                return Err(A::Error::custom(format_args!("duplicate field `{name}`")));
            }
        }
        Ok(StrictValue)
    }
}
