//! The registry of methods.

use std::fmt;

use schemars::generate::SchemaSettings;
use schemars::{Schema, SchemaGenerator, json_schema};
use serde::Deserializer;
use serde::de::{Error, IgnoredAny, MapAccess, Visitor};

use super::auto::AutoSettings;
use super::cone::ConeSettings;
use super::conic::ConicSettings;
use super::fnee::FneeSettings;
use super::light_tracing::LightTracingSettings;
use super::mnee::MneeSettings;
use super::path::PathSettings;
use super::settings::{Method, MethodSettings};
use super::sms::SmsSettings;
use crate::settings::kinds;

/// Declares the methods.
macro_rules! methods {
    ($($tag:literal => $kind:ident($settings:ty),)+) => {
        kinds! {
            /// The integrator and its settings.
            pub enum IntegratorDescription: dyn MethodSettings {
                $($tag => $kind($settings),)+
            }
        }

        impl IntegratorDescription {
            /// A line on each method, by its name.
            pub const SUMMARIES: &'static [(&'static str, &'static str)] =
                &[$(($tag, <$settings as Method>::SUMMARY)),+];

            /// Settings under which each method is probed, by its name.
            pub const PROBES: &'static [(&'static str, &'static [&'static str])] =
                &[$(($tag, <$settings as Method>::PROBES)),+];

            /// The schemas of all settings, in the order of [`Self::NAMES`].
            pub(crate) fn schemas() -> Vec<Schema> {
                let generator = || SchemaSettings::draft2020_12().into_generator();
                vec![$(generator().into_root_schema_for::<$settings>()),+]
            }

            /// Sets the largest number of vertices between camera and light.
            pub fn set_max_depth(&mut self, max_depth: u32) {
                match self {
                    $(Self::$kind(settings) => settings.max_depth = max_depth,)+
                }
            }

            /// Reads an integrator with its settings, or the name of one with its usual settings.
            pub(crate) fn or_name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct OneChoice;

                impl<'de> Visitor<'de> for OneChoice {
                    type Value = IntegratorDescription;

                    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                        formatter.write_str(
                            "one choice: a string, or an object with exactly one member, named after the choice",
                        )
                    }

                    fn visit_str<E: Error>(self, name: &str) -> Result<Self::Value, E> {
                        let named = IntegratorDescription::default().named(name);
                        named.ok_or_else(|| E::unknown_variant(name, IntegratorDescription::NAMES))
                    }

                    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                        let Some(name) = map.next_key::<String>()? else {
                            return Err(A::Error::invalid_length(0, &self));
                        };
                        let chosen = match name.as_str() {
                            $($tag => IntegratorDescription::$kind(map.next_value()?),)+
                            _ => return Err(A::Error::unknown_variant(&name, IntegratorDescription::NAMES)),
                        };
                        match map.next_key::<IgnoredAny>()? {
                            None => Ok(chosen),
                            Some(_) => Err(A::Error::invalid_length(2, &self)),
                        }
                    }
                }

                deserializer.deserialize_any(OneChoice)
            }

            /// The integrator of this name: this one, or another with its usual settings and what describes the scene
            /// rather than the method. `None` when no integrator has that name.
            #[must_use]
            pub fn named(&self, name: &str) -> Option<Self> {
                if name == self.kind() {
                    return Some(self.clone());
                }
                match name {
                    $($tag => Some(Self::$kind(<$settings as Method>::adopting(&**self))),)+
                    _ => None,
                }
            }
        }
    };
}

impl IntegratorDescription {
    /// The schema of what [`Self::or_name`] reads.
    pub(crate) fn schema_or_name(generator: &mut SchemaGenerator) -> Schema {
        let settings = generator.subschema_for::<Self>();
        json_schema!({
            "anyOf": [{ "description": "The usual settings.", "enum": Self::NAMES }, settings]
        })
    }
}

impl Default for IntegratorDescription {
    fn default() -> Self {
        Self::Auto(AutoSettings::default())
    }
}

methods! {
    "auto" => Auto(AutoSettings),
    "path" => Path(PathSettings),
    "light" => Light(LightTracingSettings),
    "cone" => Cone(ConeSettings),
    "fnee" => Fnee(FneeSettings),
    "sms" => Sms(SmsSettings),
    "mnee" => Mnee(MneeSettings),
    "conic" => Conic(ConicSettings),
}
