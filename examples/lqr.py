"""Linear-quadratic regulator about hover, with integral action: a user controller in Python.

The state is that of a rigid body near hover, in axes that rotate with the heading (yaw scheduling: the gain is computed
once, the errors are rotated): position error [m], velocity error [m/s], roll, pitch and yaw error [rad], body rates
[rad/s], and the integral of the position error [m s], which compensates a steady wind. The input is the thrust beyond
the weight [N] and the moments [N m]. Weights by Bryson's rule: one over the square of the largest tolerated deviation.
B. D. O. Anderson, J. B. Moore: Optimal Control: Linear Quadratic Methods, Prentice Hall 1990.
"""

import math

import numpy as np
from scipy.linalg import solve_continuous_are
from scipy.spatial.transform import Rotation

from lapwing.plugins import Setpoint, StateEstimate, ThrustAndMoments, VehicleModel


class Lqr:
    """State feedback u = -K x with feed-forward of the setpoint's acceleration."""

    rate = 250.0  # [Hz]

    def __init__(
        self,
        vehicle: VehicleModel,
        position: float = 0.1,
        velocity: float = 0.5,
        tilt: float = 0.15,
        yaw: float = 0.1,
        body_rate: float = 0.8,
        integral: float = 0.1,
        thrust: float = 15.0,
        moment: float = 1.5,
        yaw_moment: float = 0.4,
        tilt_max: float = 0.4,
    ):
        """Solve the Riccati equation.

        Args:
            vehicle: model of the vehicle.
            position: tolerated deviation of the position [m].
            velocity: tolerated deviation of the velocity [m/s].
            tilt: tolerated deviation of roll and pitch [rad].
            yaw: tolerated deviation of yaw [rad].
            body_rate: tolerated deviation of the body rates [rad/s].
            integral: tolerated integral of the position error [m s].
            thrust: tolerated deviation of the thrust [N].
            moment: tolerated moment about the roll and pitch axes [N m].
            yaw_moment: tolerated moment about the yaw axis [N m].
            tilt_max: limit of the setpoint's horizontal acceleration over gravity.
        """
        g = vehicle.gravity
        A = np.zeros((15, 15))
        A[0:3, 3:6] = A[6:9, 9:12] = A[12:15, 0:3] = np.eye(3)
        A[3, 7], A[4, 6] = g, -g  # nose down: forward; right side down: to the right
        B = np.zeros((15, 4))
        B[5, 0] = 1.0 / vehicle.mass
        B[9:12, 1:4] = np.diag(1.0 / np.array(vehicle.inertia_body))
        tolerated = [position] * 3 + [velocity] * 3 + [tilt, tilt, yaw] + [body_rate] * 3 + [integral] * 3
        Q = np.diag(np.array(tolerated) ** -2.0)
        R = np.diag(np.array([thrust, moment, moment, yaw_moment]) ** -2.0)
        self.gain = np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))  # (4, 15)
        self.vehicle, self.tilt_max = vehicle, tilt_max
        self.integral = np.zeros(3)  # world [m s]

    def step(self, time: float, estimate: StateEstimate, setpoint: Setpoint) -> ThrustAndMoments:
        """Return thrust and moments at `time` [s]."""
        w, x, y, z = estimate.attitude
        heading, pitch, roll = Rotation.from_quat([x, y, z, w]).as_euler("ZYX")
        c, s = math.cos(heading), math.sin(heading)
        to_heading = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        position_error = np.subtract(estimate.position_world, setpoint.position_world)
        velocity_error = np.subtract(estimate.velocity_world, setpoint.velocity_world)
        self.integral = self.integral + position_error / self.rate
        acceleration = to_heading @ setpoint.acceleration_world
        lean = np.clip(acceleration[:2] / self.vehicle.gravity, -self.tilt_max, self.tilt_max)
        turn = (heading - setpoint.yaw + math.pi) % (2.0 * math.pi) - math.pi
        angles = np.array([roll + lean[1], pitch - lean[0], turn])
        rates = np.array(estimate.omega_body) - [0.0, 0.0, setpoint.yaw_rate]
        position, velocity, integral = np.array([position_error, velocity_error, self.integral]) @ to_heading.T
        thrust, *moments = -self.gain @ np.concatenate([position, velocity, angles, rates, integral])
        upright = max(math.cos(roll) * math.cos(pitch), 0.5)
        total = (self.vehicle.mass * (self.vehicle.gravity + acceleration[2]) + thrust) / upright
        return ThrustAndMoments(total, tuple(moments), (-lean[1], lean[0]))
