//! Browser sessions.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Opens a browser session: the answer sets a cookie that stands for the token.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SessionRequest {
    /// The farm's token.
    pub token: String,
}
