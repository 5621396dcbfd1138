"""A commander by itself, told what a test says."""

import math

from services.autopilot.commander.commander import Commander
from services.autopilot.commander.view import Constants, View
from services.autopilot.estimate import EXACT
from services.autopilot.interface import Setpoint
from services.common.parameters import table
from services.table import load

DT = 0.004  # [s]
CONSTANTS = Constants(table(load("hover")), 0.35, 9.8, 0.4, False, True)
HIGH = EXACT._replace(position_world=(1.0, 2.0, 5.0))
"""An estimate in the air, at rest."""
VIEW = View(DT, HIGH, 0.0, math.nan, 0, Setpoint((1.0, 2.0, 5.0), (0.0,) * 3, (0.0,) * 3, 0.3, 0.0), 1.0, False)


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
