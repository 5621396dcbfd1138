//! External autopilot in Rust: the service `autopilot` of a scene whose `autopilot.estimator` is "ground_truth".
//!
//!     lapwing protocol rust_mission.toml --json layout.json
//!     rust_controller layout.json tcp/127.0.0.1:7450 [KEY_PREFIX] &
//!     lapwing run rust_mission.toml --external autopilot=tcp/127.0.0.1:7450 --insecure

mod bus;
mod control;
mod layout;

use bus::Bus;
use control::{Controller, Setpoint, Stage, State, Vehicle};
use layout::{Layout, Port, Row};

const NAME: &str = "autopilot";

fn named<'a>(ports: &'a [Port], name: &str) -> &'a Port {
    ports
        .iter()
        .find(|p| p.name == name)
        .unwrap_or_else(|| panic!("the scene has no port {name}"))
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, listen, rest @ ..] = arguments.as_slice() else {
        eprintln!("usage: rust_controller LAYOUT.json ENDPOINT [KEY_PREFIX]");
        std::process::exit(2);
    };
    let layout = Layout::read(path);
    let bus = Bus::open(listen, rest.first().map_or("lapwing", String::as_str), NAME);
    fly(&layout, &bus);
    bus.close();
}

fn fly(layout: &Layout, bus: &Bus) {
    let (plant, trajectory, own) = (
        layout.ports("plant"),
        layout.ports("trajectory"),
        layout.ports(NAME),
    );
    let (truth, reference) = (named(&plant, "truth"), named(&trajectory, "trajectory"));
    let (from_plant, from_trajectory) = (bus.source("plant"), bus.source("trajectory"));
    let (mut packets, mut waiting) = (bus.outlet("_step"), bus.outlet("_waiting"));
    let mut others: Vec<String> = layout
        .services
        .iter()
        .filter(|s| *s != NAME)
        .cloned()
        .collect();
    others.extend(["recorder".to_string(), format!("{NAME}_messages")]);
    let mut controller =
        Controller::new(Vehicle::of(&layout.config), 1e-9 * layout.interval_ns as f64);
    let _token = bus.join(layout.config_text.clone(), &others);
    for tick in 0.. {
        let time_ns = tick * layout.interval_ns;
        let received = from_plant.take(time_ns, bus, &mut waiting);
        let Some((plant_packet, trajectory_packet)) =
            received.zip(from_trajectory.take(time_ns, bus, &mut waiting))
        else {
            packets.put(Vec::new(), time_ns); // an empty step packet is the last one
            return;
        };
        let (measured, desired) = (
            truth.find(&plant, &plant_packet, tick),
            reference.find(&trajectory, &trajectory_packet, tick),
        );
        let state = State {
            position: truth.three(&measured, "position_world"),
            attitude: ["w", "x", "y", "z"].map(|c| truth.get(&measured, &format!("attitude.{c}"))),
            velocity: truth.three(&measured, "velocity_world"),
            omega: truth.three(&measured, "omega_body"),
        };
        let setpoint = Setpoint {
            position: reference.three(&desired, "position_world"),
            velocity: reference.three(&desired, "velocity_world"),
            acceleration: reference.three(&desired, "acceleration_world"),
            yaw: reference.get(&desired, "yaw"),
            yaw_rate: reference.get(&desired, "yaw_rate"),
        };
        let command = controller.step(&state, &setpoint);
        let flying = controller.stage == Stage::Flying;
        let finished = controller.stage == Stage::Landed && reference.get(&desired, "final") != 0.0;
        let mut packet = Vec::new();
        for port in own.iter().filter(|p| tick % p.period == 0) {
            let mut row: Row = port.blank();
            match port.name.as_str() {
                "actuators" => {
                    port.set_all(&mut row, "motor_voltage", &command.volts);
                    port.set_all(&mut row, "thrust", &command.thrust);
                    port.set_all(&mut row, "attitude_reference", &command.angles);
                    port.set(&mut row, "armed", f64::from(flying));
                }
                "estimate" => {
                    for column in [
                        "position_world",
                        "velocity_world",
                        "omega_body",
                        "acceleration_world",
                    ] {
                        port.set_all(&mut row, column, &truth.three(&measured, column));
                    }
                    for (column, value) in ["w", "x", "y", "z"].iter().zip(state.attitude) {
                        port.set(&mut row, &format!("attitude.{column}"), value);
                    }
                }
                "setpoint" => row.copy_from_slice(&desired),
                "status" => {
                    port.set(&mut row, "phase", reference.get(&desired, "phase"));
                    port.set(&mut row, "armed", f64::from(flying));
                    port.set(&mut row, "landed", f64::from(!flying));
                    port.set(&mut row, "finished", f64::from(finished));
                }
                other => panic!("the scene wants a port {other}"),
            }
            packet.extend(row.iter().flat_map(|x| x.to_le_bytes()));
        }
        packets.put(packet, time_ns);
    }
}
