"""Gains that make a loop unstable in hover."""

from lapwing.cosim.scene import Scene
from lapwing.kernels import math
from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import LOOP_WORDS, excess, open_loops
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.firmware.schema import flown_by_firmware
from lapwing.services.common.schemas.communication_schema import Communication

CASCADES = (("roll", "y_plant_input", "y"), ("pitch", "x_plant_input", "x"))  # loops of an axis, the cause first
GAINS = {  # keys of the gain set that set the gain of a loop
    "roll": "roll_inner",
    "y_plant_input": "roll_outer or roll_inner",
    "y": "roll_outer",
    "pitch": "pitch_inner",
    "x_plant_input": "pitch_outer or pitch_inner",
    "x": "pitch_outer",
}
MODELS = ("rigid_body", "multibody", "slung_load")  # plant models to which the margins apply


def unstable_loops(scene: Scene) -> list[str]:
    """Return a line for each axis of the scene's autopilot that is unstable in hover, with what to change."""
    if (
        not scene.has(Autopilot)
        or flown_by_firmware(scene)
        or scene.lookup("vehicle.model") not in MODELS
        or not known_airframe(scene).gravity
    ):
        return []
    if scene[Autopilot].controller is not None:
        return []  # the loops of user code are unknown
    config, exchange, airframe = scene[Autopilot], scene[Communication], known_airframe(scene)
    p = build(scene[GainSet].plain(), airframe)
    loops = open_loops(p, airframe, exchange.interval, exchange.loop_delay)
    factors = {name: excess(response) for name, response in loops.items()}
    result, gains = [], config.gains.rpartition("/")[2]
    for cascade in (("altitude",), ("yaw",), *CASCADES):
        name = next((name for name in cascade if factors[name] != 1.0), None)
        if name:
            result.append(f"{LOOP_WORDS[name]} unstable{_advice(name, factors[name])} of gains {gains}")
    return result


def _advice(loop: str, factor: float) -> str:
    """Return how far a loop is from stability, and the gains to change."""
    keys = GAINS.get(loop, loop)
    if math.isnan(factor):
        return f" at any gain; change {keys}"
    decibels = 20.0 * math.log(factor) / math.log(10.0)
    return f" by {abs(decibels):.1f} dB; {'lower' if decibels > 0.0 else 'raise'} {keys}"
