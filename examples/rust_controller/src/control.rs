//! Cascaded PID controllers of position and attitude for the vehicle of the run configuration.

use serde_json::Value;

use crate::layout::numbers;

const POSITION: f64 = 2.5; // bandwidth [rad/s]
const ATTITUDE: f64 = 12.0; // [rad/s]
const YAW: f64 = 4.0; // [rad/s]
const DAMPING: f64 = 0.9;
const INTEGRAL: f64 = 0.8; // [rad/s]
const CUT_HEIGHT: f64 = 0.05; // [m] above the height at rest; below it the motors stop

#[derive(Clone, Copy, PartialEq)]
pub enum Stage {
    Standing,
    Flying,
    Landed,
}

pub struct Vehicle {
    mass: f64,
    gravity: f64,
    inertia: Vec<f64>,
    rotor_x: Vec<f64>,
    rotor_y: Vec<f64>,
    spin: Vec<f64>,
    torque_per_thrust: f64,
    thrust_coefficient: f64,
    volts_per_speed: f64,
    voltage_max: f64,
    resting_height: f64,
}

/// State of the vehicle and its setpoint; world ENU, body FLU, SI units.
pub struct State {
    pub position: [f64; 3],
    pub attitude: [f64; 4], // w, x, y, z
    pub velocity: [f64; 3],
    pub omega: [f64; 3],
}

pub struct Setpoint {
    pub position: [f64; 3],
    pub velocity: [f64; 3],
    pub acceleration: [f64; 3],
    pub yaw: f64,
    pub yaw_rate: f64,
}

#[derive(Default)]
pub struct Command {
    pub volts: [f64; 4],
    pub thrust: [f64; 4],
    pub angles: [f64; 3], // desired roll, pitch, yaw [rad]
}

pub struct Controller {
    vehicle: Vehicle,
    pub stage: Stage,
    integral: [f64; 3],
    interval: f64,
}

impl Vehicle {
    pub fn of(config: &Value) -> Vehicle {
        let a = &config["services"]["autopilot"]["parameters"]["airframe"];
        let f = |value: &Value| value.as_f64().expect("a number");
        let motor = &a["motor"];
        Vehicle {
            mass: f(&a["mass"]),
            gravity: f(&a["gravity"]),
            inertia: numbers(&a["inertia_body"]),
            rotor_x: numbers(&a["rotor_x"]),
            rotor_y: numbers(&a["rotor_y"]),
            spin: numbers(&a["reaction_sign"]),
            torque_per_thrust: f(&a["torque_per_thrust"]),
            thrust_coefficient: f(&motor["thrust_coefficient"]),
            volts_per_speed: 30.0
                / std::f64::consts::PI
                / (f(&motor["gear_ratio"]) * f(&motor["speed_constant"])),
            voltage_max: f(&a["voltage_max"]),
            resting_height: f(&a["resting_height"]),
        }
    }

    /// Control allocation and motor model: return the rotors' thrusts [N] and the motors' voltages [V].
    fn allocate(&self, thrust: f64, moments: [f64; 3]) -> ([f64; 4], [f64; 4]) {
        let (mut forces, mut volts) = ([0.0; 4], [0.0; 4]);
        let square = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>();
        let (about_x, about_y) = (square(&self.rotor_y), square(&self.rotor_x));
        for i in 0..4 {
            let force = 0.25 * thrust + moments[0] * self.rotor_y[i] / about_x
                - moments[1] * self.rotor_x[i] / about_y
                + moments[2] * self.spin[i] / (4.0 * self.torque_per_thrust);
            volts[i] = (self.volts_per_speed * (force.max(0.0) / self.thrust_coefficient).sqrt())
                .min(self.voltage_max);
            forces[i] = self.thrust_coefficient * (volts[i] / self.volts_per_speed).powi(2);
        }
        (forces, volts)
    }
}

impl Controller {
    pub fn new(vehicle: Vehicle, interval: f64) -> Controller {
        Controller {
            vehicle,
            stage: Stage::Standing,
            integral: [0.0; 3],
            interval,
        }
    }

    fn advance_stage(&mut self, s: &State, r: &Setpoint) {
        let (height, desired) = (
            s.position[2] - self.vehicle.resting_height,
            r.position[2] - self.vehicle.resting_height,
        );
        self.stage = match self.stage {
            Stage::Standing if desired > 1e-6 || r.velocity[2] > 0.0 => Stage::Flying,
            Stage::Flying
                if desired < CUT_HEIGHT && r.velocity[2] <= 0.0 && height < CUT_HEIGHT =>
            {
                Stage::Landed
            }
            other => other,
        };
    }

    pub fn step(&mut self, s: &State, r: &Setpoint) -> Command {
        self.advance_stage(s, r);
        if self.stage != Stage::Flying {
            self.integral = [0.0; 3];
            return Command {
                angles: [0.0, 0.0, r.yaw],
                ..Command::default()
            };
        }
        let v = &self.vehicle;
        let mut force = [0.0; 3];
        for i in 0..3 {
            let error = r.position[i] - s.position[i];
            self.integral[i] += error * self.interval;
            let correction = POSITION * POSITION * (error + INTEGRAL * self.integral[i])
                + 2.0 * DAMPING * POSITION * (r.velocity[i] - s.velocity[i]);
            force[i] = v.mass * (r.acceleration[i] + correction);
        }
        force[2] += v.mass * v.gravity;
        let [w, x, y, z] = s.attitude;
        let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
        let pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
        let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
        let ahead = yaw.cos() * force[0] + yaw.sin() * force[1];
        let left = yaw.cos() * force[1] - yaw.sin() * force[0];
        let angles = [
            -left.atan2(ahead.hypot(force[2])),
            ahead.atan2(force[2]),
            r.yaw,
        ];
        let turn = r.yaw - yaw;
        let errors = [
            angles[0] - roll,
            angles[1] - pitch,
            turn.sin().atan2(turn.cos()),
        ];
        let rates = [-s.omega[0], -s.omega[1], r.yaw_rate - s.omega[2]];
        let mut moments = [0.0; 3];
        for (i, bandwidth) in [ATTITUDE, ATTITUDE, YAW].into_iter().enumerate() {
            moments[i] =
                v.inertia[i] * bandwidth * (bandwidth * errors[i] + 2.0 * DAMPING * rates[i]);
        }
        let upright = (roll.cos() * pitch.cos()).max(0.5);
        let (thrust, volts) = v.allocate(force[2] / upright, moments);
        Command {
            volts,
            thrust,
            angles,
        }
    }
}
