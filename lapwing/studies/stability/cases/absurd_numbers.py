"""Case 13: NaN, infinity, subnormal and extreme numbers in parameters, states and commands."""

import math
from typing import Any

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram, ExternalBlock, Service
from lapwing.cosim.run_errors import LockStepError
from lapwing.dynamics.integrators import check_start
from lapwing.dynamics.vehicles.rigid_body import FreeBodyParameters, RigidBody
from lapwing.kernels.state_tree import flatten, unflatten
from lapwing.services.common import ports
from lapwing.services.common.ports import AutopilotStatus
from lapwing.services.process_table import create
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy.systems import cooperative_load, gyrostat
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.flights import finite, fly

HARD = "NaN, infinity, 1e300 and 1e-300 where numbers are expected: rejected with time, place and value, never used"

NON_FINITE = (math.nan, math.inf, -math.inf)
ABSURD = (*NON_FINITE, 1e300, -1e300, 1e-300, 5e-324, 0.0)
KEYS = (
    "airframe.mass.total", "airframe.motor.resistance", "airframe.motor.speed_constant", "airframe.propeller.diameter",
    "airframe.propeller.pitch", "airframe.rotors.inertia", "solver.step", "effects.ground_contact.stiffness",
)  # fmt: skip
SHORT = ("run.duration=0.2",)
TICKS = 20


def reaction_to_parameter(value: float, key: str) -> str:
    """Return the reaction to an extreme parameter: "rejected", "reported", "completed" or "silent"."""
    try:
        flight = fly("hover", [f"{key}={value!r}", *SHORT])
    except ValueError:
        return "rejected"
    except ArithmeticError:
        return "silent"  # a traceback without place and value
    if flight.failure:
        return "reported" if "t = " in flight.failure or "tick" in flight.failure else "silent"
    return "completed" if finite(flight) else "silent"


def reactions_to_states() -> dict[str, int]:
    """Return the number of reactions by kind to one non-finite number in a state or in parameters of three systems."""
    result = {"rejected": 0, "silent": 0}
    systems: list[tuple[Any, Any]] = [
        (FreeBodyParameters((1.0, 1.6, 2.1)), RigidBody((1.0, 0.0, 0.0, 0.0), (0.1, 0.2, 0.3))),  # type: ignore[arg-type]
        (gyrostat.SPINNING, gyrostat.START),
        (cooperative_load._parameters(cooperative_load.PUSHED), cooperative_load.START),
    ]
    for p, x in systems:
        for example, check in ((x, lambda tree, p=p: (p, tree)), (p, lambda tree, x=x: (tree, x))):
            numbers = flatten(example)
            for k in range(len(numbers)):
                for value in NON_FINITE:
                    tree = unflatten(example, (*numbers[:k], value, *numbers[k + 1 :]))
                    try:
                        check_start(*check(tree))
                    except ValueError as error:
                        result["rejected" if str(value) in str(error) else "silent"] += 1
                    else:
                        result["silent"] += 1
    return result


def reaction_to_voltage(value: float) -> tuple[str, float]:
    """Return (reaction of a plant to a voltage at tick 10, largest absolute value in its output before)."""
    config = resolve(load("hover", SHORT))
    outputs = [config.port(ports.ACTUATORS), config.port(ports.STATUS)]
    diagram = BlockDiagram(
        config, [create(config, "plant"), Service("case", [ExternalBlock("case.commands", *outputs)], [])], 2 * TICKS
    )
    example = config.port(ports.ACTUATORS).example
    last = 0
    try:
        for tick in range(TICKS):
            volts = (value if tick == TICKS // 2 else 33.0, 33.0, 33.0, 33.0)
            diagram.put(ports.ACTUATORS, tick, example._replace(motor_voltage=volts, armed=True))
            diagram.put(ports.STATUS, tick, AutopilotStatus())
            diagram.advance(tick + 1)
            last = tick
    except LockStepError as error:
        largest = np.abs(diagram.row(ports.TRUTH, last)).max()
        return "reported" if "t = " in str(error) and "nan" in str(error) else "silent", float(largest)
    largest = np.abs(diagram.row(ports.TRUTH, last)).max()
    return ("completed" if math.isfinite(largest) else "silent"), float(largest)


def baseline_step(mass: float, volts: float) -> float:
    """Return the height after 1 s of a point mass under thrust, stepped without checks (baseline)."""
    with np.errstate(all="ignore"):
        m, v, z = np.float64(mass), np.float64(0.0), np.float64(0.0)
        for _ in range(10):
            v = v + 0.1 * (np.float64(volts) ** 2 / m - 9.81)
            z = z + 0.1 * v
        return float(z)


def _count(results: list[str], reaction: str) -> float:
    return float(sum(f == reaction for f in results))


def _count_non_finite(values: list[float]) -> float:
    return float(sum(not math.isfinite(v) for v in values))


def run() -> CaseResult:
    """Count the values that raise no error."""
    parameters = [reaction_to_parameter(value, key) for key in KEYS for value in ABSURD]
    states = reactions_to_states()
    commands = [reaction_to_voltage(value) for value in ABSURD]
    baseline = "steps without checks"
    baseline_mass = _count_non_finite([baseline_step(v, 33.0) for v in ABSURD])
    baseline_states, baseline_voltage = (
        _count_non_finite([baseline_step(10.0, v) for v in values]) for values in (NON_FINITE, ABSURD)
    )
    why = "none: a non-finite number must not propagate"
    rows = [
        Row("parameters", "checked when the scene is read, and at every tick",
            f"scenes without an error, of {len(parameters)}", 0.0, why, _count(parameters, "silent"), baseline,
            baseline_mass),
        Row("states", "`check_start`", f"numbers of states and parameters without an error, of {sum(states.values())}",
            0.0, why, float(states["silent"]), baseline, baseline_states),
        Row("commands", "the state is checked at every tick", f"voltages in flight without an error, of {len(ABSURD)}",
            0.0, why, _count([c for c, _ in commands], "silent"), baseline, baseline_voltage),
        Row("state_before", "samples of the previous tick", "of those, with a non-finite previous state", 0.0, why,
            _count_non_finite([largest for _, largest in commands]), "a single state, overwritten", baseline_voltage),
    ]  # fmt: skip
    kinds = ("rejected", "reported", "completed", "silent")
    x = np.arange(len(kinds), dtype=float)
    every = [("parameters", parameters), ("commands", [c for c, _ in commands])]
    curves = [Curve(name, x, np.array([_count(result, k) for k in kinds])) for name, result in every]
    return CaseResult(rows, Plot("0 rejected, 1 reported, 2 completed, 3 silent", "number", curves, log_y=False))
