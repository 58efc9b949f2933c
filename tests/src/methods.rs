//! Integrators with settings, by the names that comparisons and tests of laws call them.

use clerestory_render_core::specular::registry::IntegratorDescription;
use serde_json::{Value, json};

/// The integrators that find all light that comes through panes without bias; of `fnee, published`, all that its seeds
/// lead to.
pub const UNBIASED: [&str; 7] = ["path", "cone", "fnee", "fnee, published", "sms", "sms, half vector", "mnee"];

/// The settings of an integrator, as in a scene file. Beside [`UNBIASED`] there are `fnee` and `sms` with a selection
/// of panes (`fnee, sharp`). Others lack light: `fnee, M trials`, `sms, M trials`, `sms, M walks` for any number M, and
/// `mnee, dropped`. "Trials" means the published search or published walks, with estimates cut off at M.
///
/// # Panics
///
/// When there is no such integrator.
pub fn settings(name: &str) -> Value {
    match name {
        "path" | "cone" | "fnee" | "sms" | "mnee" | "auto" | "light" => json!({name: {}}),
        // Enough that tests do not notice the cut behind the glass where they compare all light.
        "fnee, published" => json!({"fnee": {"solver": "published", "max_trials": 20_000}}),
        "sms, published" => json!({"sms": {"steps": "published"}}),
        "sms, half vector" => json!({"sms": {"constraint": "half_vector"}}),
        "mnee, dropped" => json!({"mnee": {"missed": "dropped"}}),
        _ => match name.split_once(", ") {
            Some((method @ ("fnee" | "sms"), selection @ ("sharp" | "bleed" | "random"))) => {
                json!({method: {"selection": selection}})
            }
            Some((method, words)) => {
                match (method, words.split_once(' ').map(|(number, unit)| (number.parse::<u32>(), unit))) {
                    ("fnee", Some((Ok(trials), "trials"))) => {
                        json!({"fnee": {"solver": "published", "max_trials": trials}})
                    }
                    ("sms", Some((Ok(trials), "trials"))) => {
                        json!({"sms": {"steps": "published", "estimator": {"unbiased": {"max_trials": trials}}}})
                    }
                    ("sms", Some((Ok(walks), "walks"))) => biased_sms("angle_difference", walks),
                    _ => panic!("no integrator is called {name}"),
                }
            }
            _ => panic!("no integrator is called {name}"),
        },
    }
}

/// All of [`UNBIASED`] with their settings.
pub fn unbiased_integrators() -> Vec<(&'static str, Value)> {
    UNBIASED.into_iter().map(|name| (name, settings(name))).collect()
}

/// Methods and settings with selections of panes, and with light that panes reflect.
pub fn selections() -> Vec<(&'static str, Value)> {
    let names = ["fnee, sharp", "fnee, bleed", "fnee, random", "sms, sharp", "sms, random"];
    let selections = names.into_iter().map(|name| (name, settings(name)));
    selections.chain([("fnee, reflected", json!({"fnee": {"reflected": true}}))]).collect()
}

/// Whether an integrator sees lights as they are, and not as one point of each that it draws.
pub fn looks_at_whole_lights(name: &str) -> bool {
    ["path", "cone", "fnee", "auto", "light"].contains(&name)
}

/// Specular manifold sampling of all distinct paths that `walks` walks find.
pub fn biased_sms(constraint: &str, walks: u32) -> Value {
    json!({"sms": {"constraint": constraint, "estimator": {"biased": {"trials": walks}}}})
}

/// An integrator with the largest number of vertices between camera and light.
///
/// # Panics
///
/// When there is no such integrator.
pub fn integrator(name: &str, max_depth: u32) -> IntegratorDescription {
    let mut settings = settings(name);
    for settings in settings.as_object_mut().into_iter().flat_map(|integrator| integrator.values_mut()) {
        settings["max_depth"] = max_depth.into();
    }
    serde_json::from_value(settings).expect("settings that the scene format knows")
}
