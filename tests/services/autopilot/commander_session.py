"""A commander by itself, told what a test says."""

import math

from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw
from lapwing.services.autopilot.commander.commander import Commander
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.initial_estimate import EXACT
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.ports import Setpoint
from lapwing.services.scene_resolver import load

DT = 0.004  # [s]
CONSTANTS = Constants(table(load("hover")), 0.35, 9.8, 0.4, False, True)
HIGH = EXACT._replace(position_world=(1.0, 2.0, 5.0))
"""An estimate in the air, at rest."""
VIEW = CommanderInput(
    DT, HIGH, 0.0, math.nan, 0, Setpoint((1.0, 2.0, 5.0), (0.0,) * 3, (0.0,) * 3, 0.3, 0.0), 1.0, False
)


class Session:
    """A commander and the views that it is shown."""

    def __init__(self, constants=CONSTANTS):
        self.commander = Commander(constants)
        self.texts, self.acknowledgements = [], []

    def step(self, **told):
        """The request after a tick of which this is told, and else that of a vehicle that hovers."""
        request = self.commander.step(VIEW._replace(**told))
        self.texts += request.texts
        self.acknowledgements += request.acknowledgements
        return request

    def run(self, seconds, **told):
        """The last request after so long."""
        for _ in range(round(seconds / DT)):
            request = self.step(**told)
        return request


class Flight(Session):
    """A session whose vehicle is where its setpoint is, stands on the ground at first, and feels it again."""

    def __init__(self, *commands, parameters=(), constants=CONSTANTS):
        super().__init__(constants)
        self.commander.state.guidance.parameters |= dict(parameters)
        self.setpoint = Setpoint((0.0, 0.0, 0.35), (0.0,) * 3, (0.0,) * 3, 0.0, 0.0)
        self.track, self.statuses = [], []
        self.time = 0.0
        self.told(*commands)

    def told(self, *commands):
        self._advance(commands)
        return self

    def _advance(self, commands=()):
        x, y, z = self.setpoint.position_world
        estimate = EXACT._replace(
            position_world=(x, y, max(z, 0.35)),
            velocity_world=self.setpoint.velocity_world,
            attitude=from_roll_pitch_yaw(0.0, 0.0, self.setpoint.yaw),
        )
        down = self.setpoint.velocity_world[2] < 0.0 and z <= 0.36
        request = self.step(estimate=estimate, motors_cut=down, commands=tuple(commands))
        self.setpoint, self.status, self.time = request.setpoint, request.status, self.time + DT
        self.track.append((self.setpoint, self.status))

    def until(self, true, seconds=120.0):
        """Fly on until something is so of the status; says whether it is."""
        end = self.time + seconds
        while not true(self.status) and self.time < end:
            self._advance()
        return true(self.status)

    def on(self, seconds):
        self.until(lambda status: False, seconds)
        return self

    def speeds(self, near, within):
        """Horizontal speeds [m/s] near a place."""
        return [
            math.hypot(*s.velocity_world[:2]) for s, _ in self.track if math.dist(s.position_world[:2], near) < within
        ]
