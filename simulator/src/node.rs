//! A world with bodies, as a node: each body's microcontroller answers on a device, in the device's own protocol.
//!
//! Writes `truth` for the first body and `truth_NAME` for each further one: pose, clearance, contacts, as only a
//! simulator can know them. Reads no path: what it knows of the robot it learns from the bytes that the driver sends.

use crate::geometry::Pose;
use crate::laser::LaserSetup;
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
    /// Its laser scanners.
    #[serde(default)]
    pub lasers: Vec<LaserConfig>,
}

/// One laser scanner on a body. Each beam is cast exactly, at its own time; see the realism of `laser`.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LaserConfig {
    /// Driver instance whose simulated twin it is.
    pub name: String,
    /// Model: lms200, urg-04lx, utm-30lx, ust-10lx, or sinew-720 (720 beams over 270° at 50 Hz, no product: a stand-in that
    /// speaks SCIP 2.0).
    pub model: String,
    /// Ahead of the body's origin [m].
    #[serde(default)]
    pub x_m: f64,
    /// To the left of the body's origin [m].
    #[serde(default)]
    pub y_m: f64,
    /// Where it looks, counter-clockwise from ahead [deg].
    #[serde(default)]
    pub heading_deg: f64,
    /// Mounted with its top down.
    #[serde(default)]
    pub upside_down: bool,
    /// Where it answers instead: tcp:127.0.0.1:10940, pty:/path; without it where the driver's "simulator" leads.
    #[serde(default)]
    pub serve: Option<String>,
}

impl LaserConfig {
    fn setup(&self) -> LaserSetup {
        LaserSetup {
            model: self.model.clone(),
            x_m: self.x_m,
            y_m: self.y_m,
            heading_rad: self.heading_deg.to_radians(),
            upside_down: self.upside_down,
        }
    }
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
            lasers: Vec::new(),
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
    scanners: Vec<Scanner>,
}

/// A scanner's device.
struct Scanner {
    device: Device,
    over_tcp: bool,
    generation: u64,
    baud: Option<u32>,
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
        let (mut served, mut scanners) = (Vec::new(), Vec::new());
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
            for scanner in &body.lasers {
                let device = ports.serve_device(&scanner.name, scanner.serve.as_deref())?;
                let over_tcp = matches!(device.address(), Address::Tcp { .. });
                scanners.push(Scanner { device, over_tcp, generation: 0, baud: None });
            }
            setup.bodies.push(BodySetup {
                model: body.model.clone(),
                name: body.name.clone(),
                start: body.start.map(|[x_m, y_m, heading_deg]| Pose::new(x_m, y_m, heading_deg.to_radians())),
                watchdog_ms: body.watchdog_ms,
                bumpers: body.bumpers,
                chassis: body.chassis,
                lasers: body.lasers.iter().map(LaserConfig::setup).collect(),
            });
        }
        let simulation = Simulation::new(map, &setup).map_err(|e| OpenError::config(e.to_string()))?;
        Ok(World { simulation, bodies: served, scanners })
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
        for (index, scanner) in self.scanners.iter_mut().enumerate() {
            scanner.hear(&mut self.simulation, index, now, &mut bytes);
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
        for (index, scanner) in self.scanners.iter_mut().enumerate() {
            scanner.say(&mut self.simulation, index);
        }
        Ok(())
    }
}

impl Scanner {
    /// Takes what the client sends.
    fn hear(&mut self, simulation: &mut Simulation, index: usize, now: Time, bytes: &mut [u8]) {
        if let DeviceLink::Open { generation } = self.device.link()
            && std::mem::replace(&mut self.generation, generation) != generation
            && self.over_tcp
        {
            simulation.laser_restart(index);
        }
        loop {
            let count = self.device.receive(bytes);
            if count == 0 {
                return;
            }
            simulation.laser_receive(index, now, &bytes[..count]);
        }
    }

    /// Sends what the scanner says: all that is new at once, or nothing where the line is full or nobody is there.
    fn say(&mut self, simulation: &mut Simulation, index: usize) {
        simulation.laser_send(index, |bytes| {
            let _ = self.device.send(bytes);
        });
        let baud = simulation.laser_baud(index);
        if baud != self.baud {
            self.baud = baud;
            self.device.set_baud(baud.unwrap_or(DEFAULT_BAUD));
        }
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
