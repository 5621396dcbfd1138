"""Session of a commander without a controller, with inputs set by a test."""

import math

from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw
from lapwing.services.autopilot.commander.commander import Commander
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.ports import Setpoint, StateEstimate
from lapwing.services.scene_resolver import load

DT = 0.004  # [s]
CONSTANTS = Constants(table(load("hover")), 0.35, 9.8, 0.4, False, True)
HIGH = StateEstimate(position_world=(1.0, 2.0, 5.0))
"""Return an estimate at rest in the air."""
VIEW = CommanderInput(
    DT, HIGH, 0.0, math.nan, 0, Setpoint((1.0, 2.0, 5.0), (0.0,) * 3, (0.0,) * 3, 0.3, 0.0), 1.0, False
)


class Session:
    """Commander with the inputs of a hovering vehicle."""

    def __init__(self, constants=CONSTANTS):
        self.commander = Commander(constants)
        self.texts, self.acknowledgements = [], []

    def step(self, **inputs):
        """Step one tick with these inputs changed. Return the output."""
        output = self.commander.step(VIEW._replace(**inputs))
        self.texts += output.texts
        self.acknowledgements += output.acknowledgements
        return output

    def run(self, seconds, **inputs):
        """Step for a time [s]. Return the last output."""
        for _ in range(round(seconds / DT)):
            output = self.step(**inputs)
        return output


class Flight(Session):
    """Session of a vehicle that follows its setpoint exactly, from the ground to a landing."""

    def __init__(self, *commands, parameters=(), constants=CONSTANTS):
        super().__init__(constants)
        self.commander.state.guidance.parameters |= dict(parameters)
        self.setpoint = Setpoint((0.0, 0.0, 0.35), (0.0,) * 3, (0.0,) * 3, 0.0, 0.0)
        self.track, self.statuses = [], []
        self.time, self.wall = 0.0, math.inf  # [s], [m] largest x
        self.send(*commands)

    def send(self, *commands):
        """Step one tick with these commands."""
        self._advance(commands)
        return self

    def _advance(self, commands=()):
        x, y, z = self.setpoint.position_world
        vx, vy, vz = self.setpoint.velocity_world
        estimate = StateEstimate(
            position_world=(min(x, self.wall), y, max(z, 0.35)),
            velocity_world=(vx if x < self.wall else 0.0, vy, vz),
            attitude=from_roll_pitch_yaw(0.0, 0.0, self.setpoint.yaw),
        )
        down = self.setpoint.velocity_world[2] < 0.0 and z <= 0.36
        output = self.step(estimate=estimate, motors_cut=down, commands=tuple(commands))
        self.setpoint, self.status, self.time = output.setpoint, output.status, self.time + DT
        self.track.append((self.setpoint, self.status))

    def until(self, condition, seconds=120.0):
        """Fly until a condition on the status holds. Return False if it never does."""
        end = self.time + seconds
        while not condition(self.status) and self.time < end:
            self._advance()
        return condition(self.status)

    def fly_for(self, seconds):
        """Fly for a time [s]."""
        self.until(lambda status: False, seconds)
        return self

    def speeds(self, near, within):
        """Return the horizontal speeds [m/s] near a position."""
        return [
            math.hypot(*s.velocity_world[:2]) for s, _ in self.track if math.dist(s.position_world[:2], near) < within
        ]
