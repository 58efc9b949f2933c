//! The integrators of a farm.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

/// An integrator that a scene may name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct IntegratorView {
    /// Its name in a scene.
    pub name: String,
    /// A line for people who choose one.
    pub summary: String,
    /// Whether a scene that names none has it.
    pub is_default: bool,
    /// The JSON Schema (draft 2020-12) of its settings.
    #[schema(value_type = Object)]
    pub schema: Value,
    /// The settings of a scene that names it alone.
    #[schema(value_type = Object)]
    pub defaults: Value,
}
