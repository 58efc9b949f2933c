//! A worker that is led by hand: it claims and renders as a real one does, and a test decides what it brings.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use clerestory_api::{ClientError, JobId, Lease, LeaseRequest, LeaseReturn, WorkerId, WorkerRegistration};
use clerestory_film::{Node, NodeAddress, PartialHeader, Rendered, TileGrid, partial};
use clerestory_render_core::document::{SceneBundle, SceneDescription};
use clerestory_render_core::integrator::PreparedScene;
use clerestory_render_core::integrator::render_node;
use clerestory_render_core::probe;
use clerestory_render_core::scene::Asset;

use crate::calls::Caller;

/// A lease, and the sound partial of all its nodes.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// The lease.
    pub lease: Lease,
    /// The partial.
    pub partial: Vec<u8>,
}

/// A worker that renders one job.
pub struct HandWorker<'a> {
    caller: &'a Caller,
    id: WorkerId,
    scene: PreparedScene,
    grid: TileGrid,
    flips_bits: bool,
}

impl<'a> HandWorker<'a> {
    /// Registers the worker, and builds the scene of the job from what the farm sends.
    ///
    /// # Panics
    ///
    /// When the farm does not do its part.
    pub fn register(caller: &'a Caller, job: JobId) -> Self {
        let client = caller.client();
        let probed = probe::digests().expect("a probe");
        let registration = WorkerRegistration {
            name: "by hand".to_owned(),
            cores: 1,
            build: "by hand".to_owned(),
            probe_digest: Some(probed.first),
            method_digests: probed.methods,
        };
        let id = caller.wait(client.register_worker(&registration)).expect("a registration").id;
        let order = caller.wait(client.job_scene(job)).expect("the scene of the job");
        let mut assets = BTreeMap::new();
        for (name, hash) in &order.assets {
            let content = caller.wait(client.asset(hash)).expect("a file of the scene");
            assets.insert(name.clone(), Asset::new(&content[..]));
        }
        let description = SceneDescription::parse(order.scene.to_string().as_bytes()).expect("a scene");
        let bundle = SceneBundle::from_parts(description, assets).expect("a scene with its files");
        let grid = bundle.description().grid(order.tile_size).with_caustic(order.caustic);
        Self {
            caller,
            id,
            scene: PreparedScene::build(&bundle).expect("a scene that can be built"),
            grid,
            flips_bits: false,
        }
    }

    /// The same worker, with a memory that has lost the last bit of one number in each node before it is sent.
    pub fn that_flips_bits(self) -> Self {
        Self { flips_bits: true, ..self }
    }

    /// The identity of the worker.
    pub fn id(&self) -> WorkerId {
        self.id
    }

    /// Claims a lease and renders its nodes.
    ///
    /// # Panics
    ///
    /// When there is no work, or it cannot be done.
    pub fn claim(&self) -> Delivery {
        self.try_claim().expect("an answer").expect("work")
    }

    /// Claims a lease, if there is work, and renders its nodes.
    ///
    /// # Errors
    ///
    /// What the farm says against it.
    ///
    /// # Panics
    ///
    /// When they cannot be rendered.
    pub fn try_claim(&self) -> Result<Option<Delivery>, ClientError> {
        let request = LeaseRequest { worker: self.id, max_nodes: None, wanted_ms: None, wait_ms: 0, built: Vec::new() };
        let claimed = self.caller.wait(self.caller.client().claim_lease(&request))?;
        Ok(claimed.map(|lease| self.rendered(lease)))
    }

    fn rendered(&self, lease: Lease) -> Delivery {
        let nodes: Vec<Rendered> = lease.nodes.iter().map(|node| self.render(node)).collect();
        let header = PartialHeader {
            job: lease.job.to_string(),
            scene_hash: self.scene.hash().to_string(),
            build: "by hand".to_owned(),
        };
        let partial = partial::encode(&nodes, &header, &self.grid).expect("a partial");
        Delivery { lease, partial }
    }

    fn render(&self, node: &clerestory_api::NodeAddress) -> Rendered {
        let clerestory_api::NodeAddress { frame, tile, level, index } = *node;
        let address = NodeAddress { frame, tile, level, index };
        let rendered = render_node(&self.scene, &self.grid, address, &AtomicBool::new(false)).expect("a node");
        if self.flips_bits { with_flipped_bit(rendered) } else { rendered }
    }

    /// Keeps a lease for another term.
    ///
    /// # Panics
    ///
    /// When it is over.
    pub fn renew(&self, lease: &Lease) {
        self.caller.wait(self.caller.client().renew_lease(lease.id, lease.token)).expect("a lease that goes on");
    }

    /// Gives back what is left of a lease, if anything is.
    ///
    /// # Panics
    ///
    /// When the farm does not answer.
    pub fn give_back(&self, lease: &Lease) {
        let body = LeaseReturn { token: lease.token, failure: None };
        self.caller.wait(self.caller.client().return_lease(lease.id, &body)).expect("a lease that is given back");
    }
}

fn with_flipped_bit(Rendered { node, counters }: Rendered) -> Rendered {
    let (address, tile, sampling) = (node.address(), node.tile(), node.sampling());
    let mut layers = node.into_layers();
    let value = &mut layers.beauty[0][0];
    *value = f32::from_bits(value.to_bits() ^ 1);
    Rendered { node: Node::from_layers(address, tile, sampling, layers).expect("a node"), counters }
}
