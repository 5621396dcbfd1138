"""Procedure of `lapwing tune`: linear model, present gains, design for margins, refinement in simulated flights."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.complete_file import write_text
from lapwing.cosim.scene import Scene
from lapwing.cosim.scene.toml_text import dump
from lapwing.flights.flight_data import FlightData
from lapwing.services.autopilot.control import Parameters
from lapwing.services.autopilot.controller_parameters import Airframe, build
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.margins import LOOP_WORDS, Margins, margins, open_loops
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.autopilot.schema import Autopilot
from lapwing.services.common.firmware.schema import OWN, firmware_of, flown_by_firmware
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import follows_trajectory
from lapwing.services.common.schemas.vehicle_schema import Vehicle
from lapwing.studies.campaign.campaign_config import campaign_config
from lapwing.studies.tune import corners, gain_refinement
from lapwing.studies.tune.bandwidths import Bandwidths
from lapwing.studies.tune.design import DELAY, Shortfall, assumed_airframe, design, gain_set, shortfalls
from lapwing.studies.tune.identify import Identification, identify
from lapwing.studies.tune.linearise import Hover, hover


class GainReview(NamedTuple):
    """A gain set with its margins."""

    name: str
    parameters: Parameters
    margins: dict[str, Margins]
    shortfalls: dict[str, Shortfall]


class Tuning(NamedTuple):
    """Result of a tuning."""

    scene: str
    tick: float  # [s] period of the controller
    compiled_model: Hover  # linearised compiled model
    identification: Identification | None  # None without a log
    nominal: Airframe  # airframe assumed by the design
    before: GainReview
    after: GainReview
    gains: GainSet
    refinement: gain_refinement.Refinement | None  # None without a trajectory
    corners: dict[corners.Corner, gain_refinement.Figures]

    @property
    def model(self) -> Hover:
        """Linear model used for the design."""
        return self.identification.model if self.identification else self.compiled_model

    @property
    def failures(self) -> list[str]:
        """Loops of the new gains without the required margins, and failed flights of perturbed vehicles.

        Each reason is listed once: the loops that share it, and the first flight of each outcome.
        """
        flights: dict[str, list[str]] = {}
        for corner, flight in self.corners.items():
            if text := corners.failure(flight):
                flights.setdefault(flight["outcome"], []).append(f"{corner}: {text}")
        firsts = [
            first + (f" ({len(others)} other vehicles: {outcome})" if others else "")
            for outcome, (first, *others) in flights.items()
        ]
        return [*_by_reason(self.after.shortfalls), *firsts]


def tune(
    scene: Scene,
    initial: Bandwidths,
    warn: Callable[[str], None],
    log: Path | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Tuning:
    """Design a gain set for the scene's vehicle about hover and refine it in flights of the scene.

    Args:
        scene: scene with the vehicle, trajectory and wind.
        initial: initial bandwidths.
        warn: called with each warning.
        log: log to identify the plant from; None to linearise the compiled model.
        progress: called after the flights of every gain set.

    Raises:
        ValueError: the scene has no autopilot or a foreign firmware, its vehicle cannot hover, the log does not excite
            all loops, or no gains have the margins.
    """
    if not scene.has(Autopilot):
        raise ValueError(f"{scene.path}: has no [autopilot] to tune; use a scene with an autopilot")
    if flown_by_firmware(scene):
        raise ValueError(f'{scene.path}: {firmware_of(scene)} has its own gains; expected autopilot.firmware = "{OWN}"')
    for name, value in initial._asdict().items():
        if not 0.0 < value < float("inf"):
            raise ValueError(f"--{name} {value:g}: expected a bandwidth above 0 rad/s")
    airframe, tick, settings = known_airframe(scene), scene[Communication].interval, scene[Autopilot]
    present = build(scene[GainSet].plain(), airframe)
    compiled_model = hover(scene)
    identification = identify(FlightData.read(log), present, compiled_model) if log else None
    model = identification.model if identification else compiled_model
    plant = assumed_airframe(airframe, model)
    before = _review(settings.gains, present, plant, tick)
    if faults := _by_reason(before.shortfalls):
        warn(f"warning: present gains {settings.gains} of the scene: {'; '.join(faults)}")
    bandwidths = design(model, airframe, tick, initial, warn)
    gains, refinement, corner_flights = gain_set(model, bandwidths), None, {}
    if follows_trajectory(scene) and scene[Vehicle].model == "rigid_body" and not settings.accept_commands:
        refinement = gain_refinement.refine(scene, model, airframe, tick, bandwidths, progress)
        gains = refinement.gains
        config = corners.with_gains(campaign_config(scene), gains)
        corner_flights = {c: corners.metrics_of(corners.with_vehicle(config, scene, c)) for c in corners.CORNERS}
    else:
        warn("gains are not refined: the autopilot of the scene does not follow a [trajectory]")
    after = _review("new", build(gains.plain(), airframe), plant, tick)
    return Tuning(
        scene.name, tick, compiled_model, identification, plant, before, after, gains, refinement, corner_flights
    )


def _review(name: str, parameters: Parameters, plant: Airframe, tick: float) -> GainReview:
    loops = open_loops(parameters, plant, tick, DELAY)
    return GainReview(
        name, parameters, {loop: margins(response) for loop, response in loops.items()}, shortfalls(loops)
    )


def _by_reason(shortfalls: Mapping[str, Shortfall]) -> list[str]:
    """Return a text for each reason, such as "phase margin below 45 deg: roll, pitch loop", from `shortfalls`."""
    loops: dict[str, list[str]] = {}
    for name, shortfall in shortfalls.items():
        loops.setdefault(shortfall.reason, []).append(LOOP_WORDS[name].removesuffix(" loop"))
    return [f"{reason}: {', '.join(names)} loop" for reason, names in loops.items()]


def write(path: Path, gains: GainSet) -> None:
    """Write a gain set to a TOML file for `autopilot.gains`."""
    head = "# Force demand [N] of every rotor, or tilt [rad], per [m] or [rad]: P, I, D\n"
    write_text(path, head + dump(gains.model_dump()))
