"""Estimates of a vehicle's figures from those that are known: the most plausible values that fit together.

Typical relations between figures are power laws with a spread (how far real vehicles deviate from them). The unknown
figures minimise the squared deviations over the spreads, so every known figure informs every estimate, in any order.
The electrical figures then follow from the required thrust, and never limit it below what the battery allows.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from lapwing.cli.vehicle_measurements import BY_NAME, Values
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.vehicles.airframe_tables import Propeller
from lapwing.dynamics.vehicles.performance import CELL_VOLTAGE
from lapwing.dynamics.vehicles.propeller import drag_coefficients, thrust_coefficient, torque_coefficient

FAMILY = {  # blade-element constants of common two-blade propellers
    "aspect_ratio": 6.0,
    "downwash_factor": 0.85,
    "radius_weight": 0.5,
    "oswald_factor": 0.83,
    "zero_lift_angle": 0.0,
    "lift_curve_slope": 6.11,
}
LARGEST_CORRECTION = 0.95  # lift_correction above which broader blades are assumed
BROADEST = 3.0  # smallest aspect ratio of a blade
TO_SPEED = math.pi / 30.0  # [rad/s] in one rpm
HOVER_SHARE = 1.0 / 1.85  # typical rotor speed in hover over that without load
WEAK = 1.4  # thrust over weight below which control authority is small
ENOUGH = math.sqrt(1.15 * WEAK)  # speed at full throttle over that in hover of a vehicle that is not weak
LEAST_SHARE = 0.8  # typical speed at full throttle over that without load
USUAL, TIGHT = 0.2, 0.02  # spreads of HOVER_SHARE; the second is used where the first gives a weak vehicle
MOST_UNUSUAL = 20.0  # ratio of an estimate to its usual value, beyond which known figures contradict each other
CURRENT, CURRENT_MARGIN = "current", 1.2  # smallest limit of a motor's current over the current at full throttle
Relation = tuple[
    str, float, dict[str, float], float
]  # figure = factor * product of figures to powers; spread of its log


def estimate(known: Values) -> dict[str, float]:
    """Return all figures: the known ones, and estimates of the others that fit them.

    Raises:
        ConfigError: known figures contradict each other.
    """
    v = _most_plausible(known, USUAL)
    if _hover_share(v) > LEAST_SHARE / ENOUGH:
        v = _most_plausible(known, TIGHT)
    limit = _current_limit(v, known)
    if limit < CURRENT_MARGIN * _full_current(v):
        v = _most_plausible({**known, CURRENT: limit}, TIGHT)
    _fit_inertia(v, known)
    _fit_propeller(v, known)
    return _with_electrics(v, known)


def check_fit(known: Values) -> None:
    """Raise ConfigError for a figure that the others contradict: an estimate is far from that of any usual vehicle."""
    ratio, name, value, usual = _farthest(known)
    if ratio > MOST_UNUSUAL:
        others = {cause: {other: known[other] for other in known if other != cause} for cause in known}
        usual_vehicle = estimate({})
        causes = [each for each in known if _farthest(others[each])[0] <= MOST_UNUSUAL] or list(known)
        cause = max(causes, key=lambda each: abs(math.log((known[each] or 1.0) / (usual_vehicle[each] or 1.0))))
        expected = f"about {estimate(others[cause])[cause]:.2g}, or others that fit it"
        message = f"{known[cause]:g} {BY_NAME[cause].unit} needs {name} = {value:.3g}, where about {usual:.2g} is usual"
        raise ConfigError(cause, message, expected)


def _farthest(known: Values) -> tuple[float, str, float, float]:
    """Return the estimate farthest from a typical relation: its ratio to the usual value, name, value, usual value."""
    v, farthest = estimate(known), (1.0, "", 0.0, 0.0)
    v.pop(CURRENT, None)
    for figure, factor, powers, _ in _relations(v, USUAL):
        exponents = {figure: 1.0, **{name: -power for name, power in powers.items()}}
        excess = sum(exponent * math.log(v[each]) for each, exponent in exponents.items()) - math.log(factor)
        name = next((name for name in exponents if powers and name not in known), "")  # any mass is usual
        ratio = math.exp(abs(excess / exponents[name])) if name else 1.0
        if ratio > farthest[0] and not (name == "cells" and v[name] == 1.0):
            farthest = ratio, name, v[name], v[name] * math.exp(-excess / exponents[name])
    return farthest


def propeller(v: Values) -> Propeller:
    """Return the propeller's geometry, with a lift_correction of 1 and no profile drag.

    Its blades are as broad as the thrust on the stand requires.
    """
    geometry: dict[str, Any] = {"diameter": v["diameter"], "pitch": v["pitch"], "blades": int(v["blades"]), **FAMILY}
    shape = Propeller.model_validate({**geometry, "lift_correction": 1.0, "zero_lift_drag": 0.0})
    correction = v["stand_thrust"] / _most_thrust(shape, v)
    if correction > LARGEST_CORRECTION:  # thrust is proportional to 1 / (aspect ratio + share)
        share = shape.lift_curve_slope / math.pi
        ratio = (shape.aspect_ratio + share) * LARGEST_CORRECTION / correction - share
        shape = shape.model_copy(update={"aspect_ratio": max(ratio, BROADEST)})
    return shape


def _most_thrust(shape: Propeller, v: Values) -> float:
    """Return the thrust [N] with a lift_correction of 1 at the speed of the stand."""
    return (
        v["stand_density"] * (v["stand_speed"] / (2.0 * math.pi)) ** 2 * shape.diameter**4 * thrust_coefficient(shape)
    )


def _relations(v: Values, spread: float) -> Iterator[Relation]:
    """Yield the typical relations; whole numbers and factors are known."""
    rotors, blades, density = v["rotors"], v["blades"], v["stand_density"]
    yield "mass", 2.0, {}, 3.0
    yield "arm", 0.16, {"mass": 0.5}, 0.3
    yield "diameter", 1.6 * math.sin(math.pi / rotors), {"arm": 1.0}, 0.12  # neighbours at 1.25 diameters
    yield "pitch", 0.45, {"diameter": 1.0}, 0.15
    yield "inertia_x", 0.2, {"mass": 1.0, "arm": 2.0}, 0.4
    yield "inertia_y", 1.1, {"inertia_x": 1.0}, 0.1
    yield "inertia_z", 1.89, {"inertia_x": 1.0}, 0.1
    # coefficients of thrust and torque from the static measurements of the propellers in vehicle_parts.toml
    thrust = 0.1 * 0.45**-0.4 * (0.5 * blades) ** 0.8 * density / (2.0 * math.pi) ** 2
    yield "stand_thrust", thrust, {"stand_speed": 2.0, "diameter": 3.6, "pitch": 0.4}, 0.07
    torque = 0.068 * 0.45**-0.6 * (0.5 * blades) ** 0.5
    yield "stand_torque", torque, {"stand_thrust": 1.0, "diameter": 0.4, "pitch": 0.6}, 0.15
    yield "stand_thrust", STANDARD_GRAVITY / rotors, {"mass": 1.0}, 0.5
    yield "cells", 2.8, {"mass": 0.5}, 0.5
    powers = {"stand_speed": 1.0, "mass": 0.5, "stand_thrust": -0.5, "cells": -1.0}
    factor = math.sqrt(STANDARD_GRAVITY / rotors) / (HOVER_SHARE * CELL_VOLTAGE * TO_SPEED * v["gear_ratio"])
    yield "speed_constant", factor, powers, spread
    yield "capacity", 10_000.0, {"mass": 1.0, "cells": -1.0}, 0.4  # [mAh] about 37 W h for each kg

    if CURRENT in v:  # of the motor at full throttle, known where a limit of the current is below the usual
        full = (
            CURRENT_MARGIN * (LEAST_SHARE / HOVER_SHARE) ** 2 * STANDARD_GRAVITY / rotors * TO_SPEED * v["gear_ratio"]
        )
        yield CURRENT, full, {"stand_torque": 1.0, "stand_thrust": -1.0, "mass": 1.0, "speed_constant": 1.0}, TIGHT


def _most_plausible(known: Values, spread: float) -> dict[str, float]:
    fixed = {"payload": 0.0, "rotors": 4.0, "blades": 2.0, "stand_density": 1.225, "gear_ratio": 1.0, **known}
    v = fixed | _least_squares(fixed, spread)
    if "cells" not in known:
        fixed["cells"] = max(1.0, round(v["cells"]))
        v = fixed | _least_squares(fixed, spread, rounded="cells")
    return v


def _least_squares(v: Values, spread: float, rounded: str = "") -> dict[str, float]:
    """Return the unknown figures of all relations; a rounded figure is no evidence for its own relation."""
    relations = [relation for relation in _relations(v, spread) if relation[0] != rounded]
    unknown = sorted({name for relation in relations for name in (relation[0], *relation[2])} - set(v))
    rows, right = [], []
    for name, factor, powers, deviation in relations:
        logarithms = {name: 1.0, **{other: -power for other, power in powers.items()}}
        rows.append([logarithms.get(other, 0.0) / deviation for other in unknown])
        rest = sum(power * math.log(v[other]) for other, power in logarithms.items() if other in v)
        right.append((math.log(factor) - rest) / deviation)
    if not unknown:
        return {}
    solution = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    return dict(zip(unknown, np.exp(solution).tolist(), strict=True))


def hover_speed(v: Values) -> float:
    """Return the rotor speed [rad/s] in hover."""
    return v["stand_speed"] * math.sqrt(v["mass"] * STANDARD_GRAVITY / v["rotors"] / v["stand_thrust"])


def _full_current(v: Values) -> float:
    """Return the usual current [A] of a motor at full throttle."""
    ((_, factor, powers, _),) = (each for each in _relations({**v, CURRENT: 1.0}, USUAL) if each[0] == CURRENT)
    return factor / CURRENT_MARGIN * math.prod(v[name] ** power for name, power in powers.items())


def _current_limit(v: Values, known: Values) -> float:
    """Return the known limit of a motor's current [A], inf if there is none."""
    limits = [known[name] for name in ("esc_current", "peak_current") if name in known]
    if "c_rating" in known and "capacity" in known:
        limits.append(known["c_rating"] * known["capacity"] / 1000.0 / v["rotors"])
    return min(limits, default=math.inf)


def _no_load_speed(v: Values) -> float:
    return v["speed_constant"] * v["gear_ratio"] * CELL_VOLTAGE * v["cells"] * TO_SPEED


def _hover_share(v: Values) -> float:
    return hover_speed(v) / _no_load_speed(v)


def _fit_inertia(v: dict[str, float], known: Values) -> None:
    """Let the estimated moments of inertia meet the triangle inequality, by which none exceeds the other two."""
    for name in ("inertia_x", "inertia_y", "inertia_z"):
        a, b = (v[other] for other in ("inertia_x", "inertia_y", "inertia_z") if other != name)
        if name not in known:
            v[name] = min(max(v[name], 1.02 * abs(a - b)), 0.98 * (a + b))


def _fit_propeller(v: dict[str, float], known: Values) -> None:
    """Let the estimates of the stand be those that a propeller of this size can have."""
    shape = propeller({**v, "stand_thrust": 0.0})
    broad = shape.model_copy(update={"aspect_ratio": BROADEST})
    excess = v["stand_thrust"] / (LARGEST_CORRECTION * _most_thrust(broad, v))
    if excess > 1.0 and "stand_thrust" not in known:
        v["stand_thrust"] /= excess
    elif excess > 1.0 and "stand_speed" not in known:
        v["stand_speed"] *= math.sqrt(excess)
    shape = propeller(v)
    least = v["stand_thrust"] * _induced_arm(shape)
    if v["stand_torque"] < 1.1 * least:
        if "stand_torque" not in known:
            v["stand_torque"] = 1.1 * least
        elif "stand_thrust" not in known:
            v["stand_thrust"] *= v["stand_torque"] / (1.1 * least)


def _induced_arm(shape: Propeller) -> float:
    """Return the least torque over thrust [m], that of induced drag alone."""
    assert drag_coefficients(shape)[0] == 0.0
    return torque_coefficient(shape) * shape.diameter / thrust_coefficient(shape)


def _with_electrics(v: dict[str, float], known: Values) -> dict[str, float]:
    """Return all figures with those of motor, battery and frame."""
    voltage, hours = CELL_VOLTAGE * v["cells"], v["capacity"] / 1000.0
    constant = voltage / _no_load_speed(v)  # [N m/A]
    load = v["stand_torque"] / v["stand_speed"] ** 2 / constant  # [A s^2/rad^2]
    # share of full throttle in the no-load speed, more for a motor that would lift too little
    share = min(max(LEAST_SHARE, ENOUGH * _hover_share(v)), 0.95)
    full = load * (share * _no_load_speed(v)) ** 2
    v["no_load_current"] = known.get("no_load_current", 0.03 * full)
    v["resistance"] = known.get("resistance", (1.0 - share) * voltage / (full + v["no_load_current"]))
    drop = v["resistance"] * v["no_load_current"]
    if drop >= voltage:
        raise ConfigError(
            "resistance",
            f"{v['resistance']:g} ohm take {drop:.3g} V at no_load_current = {v['no_load_current']:.3g} A, of "
            f"{voltage:.3g} V",
            f"less than {voltage / v['no_load_current']:.3g} ohm",
        )
    # V = K w + R (load w^2 + I_0)
    quadratic = v["resistance"] * load
    fastest = 2.0 * (voltage - drop) / (constant + math.sqrt(constant**2 + 4.0 * quadratic * (voltage - drop)))
    current = load * fastest**2 + v["no_load_current"]
    pack = CURRENT_MARGIN * v["rotors"] * current
    if "capacity" not in known and "c_rating" in known:
        hours = max(hours, pack / v["c_rating"])
    arm = v["arm"]
    return {
        **v,
        "rotor_inertia": 6.0e-5 * (v["diameter"] / 0.254) ** 5,
        "capacity": 1000.0 * hours,
        "c_rating": max(30.0, pack / hours),
        "cell_resistance": 0.02 / hours,
        "esc_current": CURRENT_MARGIN * current,
        "peak_current": CURRENT_MARGIN * current,
        "time_constant": 0.05 * v["diameter"] ** 0.5,
        "foot_depth": 0.7 * arm,
        "foot_distance": 0.75 * arm,
        "drag_area": 0.5 * arm**2,
        **known,
    }
