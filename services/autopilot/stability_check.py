"""Warning about gains that make a loop unstable in hover."""

from lapwing.cosim.scene import Scene
from lapwing.kernels import math
from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import excess, open_loops
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.communication_schema import Communication
from lapwing.services.common.firmware.schema import flown_by_firmware

MODELS = ("rigid_body", "multibody", "slung_load")  # plant models to which the margins apply


def unstable_loops(scene: Scene) -> list[str]:
    """Return a line for each loop of the scene's autopilot that is unstable in hover, with its gain margin."""
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
    peaks = {name: excess(response) for name, response in loops.items()}
    return [f"gains {config.gains}: {name}: unstable{_by(factor)}" for name, factor in peaks.items() if factor != 1.0]


def _by(factor: float) -> str:
    if math.isnan(factor):
        return " at any gain"
    decibels = 20.0 * math.log(factor) / math.log(10.0)
    return f", gain margin {-abs(decibels):.1f} dB: the gain is too {'high' if decibels > 0.0 else 'low'}"
