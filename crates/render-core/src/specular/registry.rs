//! The registry of methods.

use super::cone::ConeSettings;
use super::conic::ConicSettings;
use super::fnee::FneeSettings;
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

            /// Largest number of vertices between camera and light.
            pub fn max_depth(&self) -> u32 {
                match self {
                    $(Self::$kind(settings) => settings.max_depth,)+
                }
            }

            /// Sets the largest number of vertices between camera and light.
            pub fn set_max_depth(&mut self, max_depth: u32) {
                match self {
                    $(Self::$kind(settings) => settings.max_depth = max_depth,)+
                }
            }

            /// The integrator of this name: this one, or another with its usual settings and what describes the scene
            /// rather than the method. `None` when no integrator has that name.
            #[must_use]
            pub fn named(&self, name: &str) -> Option<Self> {
                if name == self.kind() {
                    return Some(self.clone());
                }
                match name {
                    $($tag => Some(Self::$kind(<$settings as Method>::adopting(self))),)+
                    _ => None,
                }
            }
        }
    };
}

methods! {
    "path" => Path(PathSettings),
    "cone" => Cone(ConeSettings),
    "fnee" => Fnee(FneeSettings),
    "sms" => Sms(SmsSettings),
    "mnee" => Mnee(MneeSettings),
    "conic" => Conic(ConicSettings),
}
