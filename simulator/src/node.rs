//! A world with bodies, as a node: each body's microcontroller answers on a device, in the device's own protocol.
//!
//! Writes `truth` for the first body and `truth_NAME` for each further one: pose, clearance, contacts, as only a
//! simulator can know them. Reads no path: what it knows of the robot it learns from the bytes that the driver sends.

use crate::geometry::Pose;
use crate::realism::Realism;
use crate::simulation::{BodySetup, Chassis, Setup, Simulation};
use crate::world::World as Map;
use messages::{Contact, Truth};
use runtime::device::{Address, DEFAULT_BAUD, DeviceLink};
use runtime::{Device, Fault, Layer, Node, OpenError, Ports, Time, Writer};
use schemars::JsonSchema;
use serde::Deserialize;

/// Settings of [`World`].
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorldConfig {
    /// World file, relative to the robot's folder: TOML, or a map_server YAML.
    pub world: String,
    /// The bodies in it; without any, one for the driver instance `base`.
    #[serde(default)]
    pub bodies: Vec<BodyConfig>,
    /// Imperfections of wheels, sonar and line.
    #[serde(default)]
    pub realism: Realism,
}

/// One body.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyConfig {
    /// Driver instance whose simulated twin it is.
    pub name: String,
    /// Model: p3dx-sh, p3dx, jackal (a stand-in that speaks P2OS, which no real Jackal does).
    #[serde(default = "default_model")]
    pub model: String,
    /// Start pose: x, y [m], heading [deg]; without it the world's own start.
    #[serde(default)]
    pub start: Option<[f64; 3]>,
    /// Where its controller answers instead: tcp:127.0.0.1:8101, pty:/path; without it where the driver's
    /// "simulator" leads.
    #[serde(default)]
    pub serve: Option<String>,
    /// Silence after which the controller stops the robot [ms].
    #[serde(default = "default_watchdog_ms")]
    pub watchdog_ms: u16,
    /// Whether bumpers are fitted.
    #[serde(default = "default_bumpers")]
    pub bumpers: bool,
    /// Outline, wheels and controller where they are not the model's.
    #[serde(default)]
    pub chassis: Chassis,
}

fn default_model() -> String {
    BodySetup::default().model
}

fn default_watchdog_ms() -> u16 {
    BodySetup::default().watchdog_ms
}

fn default_bumpers() -> bool {
    BodySetup::default().bumpers
}

impl BodyConfig {
    fn twin_of(name: &str) -> BodyConfig {
        BodyConfig {
            name: name.into(),
            model: default_model(),
            start: None,
            serve: None,
            watchdog_ms: default_watchdog_ms(),
            bumpers: default_bumpers(),
            chassis: Chassis::default(),
        }
    }
}

/// Contacts that one sample of the truth can list; more are counted all the same.
const CONTACTS: usize = 16;
/// Bytes moved between a device and a controller at once.
const CHUNK: usize = 1024;

/// The node.
pub struct World {
    simulation: Simulation,
    bodies: Vec<Served>,
}

/// A body's device and what is published of it.
struct Served {
    device: Device,
    /// A TCP client that is gone takes its session along; a serial line does not tell the controller who listens.
    over_tcp: bool,
    generation: u64,
    baud: Option<u32>,
    truth: Writer<Truth>,
    contacts: Vec<Contact>,
}

impl Node for World {
    const TYPE: &'static str = "world";
    const LAYER: Layer = Layer::Simulator;
    type Config = WorldConfig;

    fn open(ports: &mut Ports, config: WorldConfig) -> Result<World, OpenError> {
        let map = Map::load(&config.world, &mut |file| ports.resource(file).map_err(|e| e.to_string()))
            .map_err(|e| OpenError::Resource { reason: e.to_string() })?;
        let bodies = match config.bodies.is_empty() {
            true => vec![BodyConfig::twin_of("base")],
            false => config.bodies,
        };
        let mut served = Vec::new();
        let mut setup = Setup { bodies: Vec::new(), seed: ports.seed(), realism: config.realism };
        for (index, body) in bodies.iter().enumerate() {
            // Ports are named once per run: the few bytes live as long as the process.
            let port = if index == 0 { "truth" } else { String::leak(format!("truth_{}", body.name)) };
            let device = ports.serve_device(&body.name, body.serve.as_deref())?;
            served.push(Served {
                over_tcp: matches!(device.address(), Address::Tcp { .. }),
                generation: 0,
                baud: None,
                device,
                truth: ports.writer_with_tail(port, CONTACTS)?,
                contacts: Vec::with_capacity(CONTACTS),
            });
            setup.bodies.push(BodySetup {
                model: body.model.clone(),
                name: body.name.clone(),
                start: body.start.map(|[x_m, y_m, heading_deg]| Pose::new(x_m, y_m, heading_deg.to_radians())),
                watchdog_ms: body.watchdog_ms,
                bumpers: body.bumpers,
                chassis: body.chassis,
            });
        }
        let simulation = Simulation::new(map, &setup).map_err(|e| OpenError::config(e.to_string()))?;
        Ok(World { simulation, bodies: served })
    }

    fn start(&mut self, now: Time) -> Result<(), Fault> {
        self.simulation.begin(now);
        Ok(())
    }

    fn step(&mut self, now: Time) -> Result<(), Fault> {
        let mut bytes = [0; CHUNK];
        for (index, body) in self.bodies.iter_mut().enumerate() {
            body.follow_link(&mut self.simulation, index);
            loop {
                let count = body.device.receive(&mut bytes);
                if count == 0 {
                    break;
                }
                self.simulation.receive(index, &bytes[..count]);
            }
        }
        let before = self.simulation.now();
        self.simulation.advance(now);
        let moved = self.simulation.now() > before;
        for (index, body) in self.bodies.iter_mut().enumerate() {
            let count = self.simulation.send(index, &mut bytes);
            if count > 0 {
                // Nobody at the other end: a controller talks on all the same.
                let _ = body.device.send(&bytes[..count]);
            }
            if let Some(controller) = self.simulation.controller(index) {
                if controller.take_hung_up() && body.over_tcp {
                    body.device.reopen();
                }
                let baud = controller.requested_baud();
                if baud != body.baud {
                    body.baud = baud;
                    body.device.set_baud(baud.unwrap_or(DEFAULT_BAUD));
                }
            }
            if moved {
                let contacts = &mut body.contacts;
                contacts.clear();
                self.simulation.take_contacts(index, |contact| {
                    if contacts.len() < CONTACTS {
                        contacts.push(contact);
                    }
                });
                let truth = self.simulation.truth(index);
                body.truth.write_with_tail(self.simulation.now(), &truth, &body.contacts);
            }
        }
        Ok(())
    }
}

impl Served {
    /// Begins a new session for every new TCP client.
    fn follow_link(&mut self, simulation: &mut Simulation, index: usize) {
        let DeviceLink::Open { generation } = self.device.link() else { return };
        let known = std::mem::replace(&mut self.generation, generation);
        if self.over_tcp
            && known != generation
            && let Some(controller) = simulation.controller(index)
        {
            controller.restart();
        }
    }
}
