//! The registry of the kinds of a thing: one line for each kind, and no `match` over kinds anywhere else.

/// Declares the kinds of a thing as an enum. In a scene file a kind is an object with one member, named after the kind,
/// whose value is the settings. The enum dereferences to the trait that all settings implement.
macro_rules! kinds {
    (
        $(#[$meta:meta])*
        pub enum $name:ident: dyn $trait:ident {
            $($(#[$kind_meta:meta])* $tag:literal => $kind:ident($settings:ty),)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub enum $name {
            $(
                $(#[$kind_meta])*
                #[expect(missing_docs, reason = "its settings say what it is")]
                #[serde(rename = $tag)]
                $kind($settings),
            )+
        }

        impl $name {
            /// The names of all kinds, as scene files have them.
            pub const NAMES: &'static [&'static str] = &[$($tag),+];

            /// The name of this kind, as scene files have it.
            pub fn kind(&self) -> &'static str {
                match self {
                    $(Self::$kind(_) => $tag,)+
                }
            }
        }

        impl std::ops::Deref for $name {
            type Target = dyn $trait;

            fn deref(&self) -> &Self::Target {
                match self {
                    $(Self::$kind(settings) => settings,)+
                }
            }
        }

        impl std::ops::DerefMut for $name {
            fn deref_mut(&mut self) -> &mut Self::Target {
                match self {
                    $(Self::$kind(settings) => settings,)+
                }
            }
        }
    };
}

pub(crate) use kinds;
