//! What the types cannot say about the settings of an integrator.

use super::description::{
    IntegratorDescription, MOST_SPECULAR_VERTICES, ManifoldEstimator, MeshDescription, SceneDescription,
};
use crate::settings::Check;
use crate::settings::JsonPath;
use crate::settings::SceneError;
use crate::settings::check::{Quoted, check_range};

impl SceneDescription {
    /// Checks the settings of the integrator by themselves.
    pub(super) fn check_integrator(&self, path: &JsonPath<'_>) -> Check {
        let integrator = &self.integrator;
        let path = path.member(integrator.name());
        check_range(integrator.max_depth(), 1, 1000, &path.member("max_depth"))?;
        match integrator {
            IntegratorDescription::Fnee { max_trials, .. } => {
                check_range(*max_trials, 1, 1_000_000, &path.member("max_trials"))
            }
            IntegratorDescription::Mnee { chains, .. } => check_chains(chains, "T", MOST_SPECULAR_VERTICES, &path),
            IntegratorDescription::Conic { chains, .. } => check_chains(chains, "RT", 1, &path),
            IntegratorDescription::Sms { estimator, chains, .. } => {
                check_chains(chains, "RT", MOST_SPECULAR_VERTICES, &path)?;
                let path = path.member("estimator");
                match estimator {
                    ManifoldEstimator::Unbiased { max_trials } => {
                        check_range(*max_trials, 1, 10_000_000, &path.member("unbiased").member("max_trials"))
                    }
                    ManifoldEstimator::Biased { trials } => {
                        check_range(*trials, 1, 10_000, &path.member("biased").member("trials"))
                    }
                }
            }
            IntegratorDescription::Path { .. } | IntegratorDescription::Cone { .. } => Ok(()),
        }
    }

    /// Checks what the integrator says about other parts of the scene.
    pub(super) fn check_integrator_names(&self, path: &JsonPath<'_>) -> Check {
        let (IntegratorDescription::Sms { casters, receivers, .. }
        | IntegratorDescription::Mnee { casters, receivers, .. }
        | IntegratorDescription::Conic { casters, receivers, .. }) = &self.integrator
        else {
            return Ok(());
        };
        let is_smooth =
            |mesh: &&MeshDescription| self.materials.get(&mesh.material).is_some_and(|material| material.is_delta());
        let (smooth, others): (Vec<_>, Vec<_>) = self.meshes.iter().partition(is_smooth);
        let panes = self.panes.iter().map(|pane| pane.name.as_str());
        let smooth = smooth.iter().map(|mesh| mesh.name.as_str());
        let (specular, kind): (Vec<&str>, _) = match self.integrator {
            IntegratorDescription::Conic { .. } => (smooth.collect(), "a smooth mesh"),
            _ => (panes.chain(smooth).collect(), "a pane or a smooth mesh"),
        };
        let diffuse: Vec<&str> = others.iter().map(|mesh| mesh.name.as_str()).collect();
        let path = path.member(self.integrator.name());
        check_known(casters.as_ref(), &specular, kind, &path.member("casters"))?;
        check_known(receivers.as_ref(), &diffuse, "a mesh that scatters light", &path.member("receivers"))
    }
}

fn check_chains(chains: &[String], letters: &str, longest: usize, path: &JsonPath<'_>) -> Check {
    let path = path.member("chains");
    if chains.is_empty() || chains.len() > MOST_SPECULAR_VERTICES {
        return Err(SceneError::value(&path, format_args!("{} words", chains.len()), "1 to 16 words"));
    }
    for (index, chain) in chains.iter().enumerate() {
        let length = chain.chars().count();
        let fits = (1..=longest).contains(&length) && chain.chars().all(|sign| letters.contains(sign));
        if !fits || chains[..index].contains(chain) {
            let letters: Vec<String> = letters.chars().map(String::from).collect();
            let length = if longest == 1 { "one letter of".to_owned() } else { format!("1 to {longest} letters") };
            let expected = format!("another word than those before, of {length} {}", letters.join(" and "));
            return Err(SceneError::value(&path.element(index), Quoted(chain), expected));
        }
    }
    Ok(())
}

fn check_known(names: Option<&Vec<String>>, known: &[&str], kind: &str, path: &JsonPath<'_>) -> Check {
    for (index, name) in names.into_iter().flatten().enumerate() {
        if !known.contains(&name.as_str()) {
            let expected = format!("the name of {kind} ({})", known.join(", "));
            return Err(SceneError::value(&path.element(index), Quoted(name), expected));
        }
    }
    Ok(())
}
