"""`lapwing new vehicle`: an interview about the measurements of a vehicle, and the airframe file from the answers."""

import math
import sys
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.new_command import new
from lapwing.cli.vehicle_measurements import FIGURES, Figure, Values, parse_settings, without_unit
from lapwing.cosim.complete_file import write_text
from lapwing.cosim.processes.interrupt import Interrupted
from lapwing.dynamics.config_error import ConfigError

if TYPE_CHECKING:
    from lapwing.dynamics.vehicles.airframe import Airframe


Ask = Callable[[Figure, float, Callable[[float], object]], float | None]


@new.command()
def vehicle(
    name: Annotated[str, typer.Argument(metavar="NAME", help="name of the vehicle and of its file: my_quad")],
    measured: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="FIGURE=VALUE",
            help="figure, e.g. mass=750g, diameter=7in, cells=6S, or a part, e.g. motor=kde4014xf_380 (repeatable)",
        ),
    ] = None,
) -> None:
    """Create an airframe: vehicles/NAME.toml, from measurements.

    In a terminal, the command asks for each measurement and explains it (see docs/guides/new_airframe.md). Elsewhere,
    measurements without --set are estimated from the others and marked as estimates in the file. Parts (motor,
    propeller, cell) set several figures, from published data or a size as propeller=10x4.5.
    """
    settings = measured or []
    values = parse_settings(settings)
    interview = Interview(name, values) if sys.stdin.isatty() else None
    try:
        path, lift, remarks = write_vehicle(
            name, values, Path(), interview.ask if interview else None, without_unit(settings)
        )
    except (ValueError, Interrupted) as error:
        if interview:
            interview.print_answers()
        if isinstance(error, ConfigError):
            raise ConfigError(f"--set {error.key}", error.message, error.expected) from None
        raise
    typer.echo(path)
    typer.echo(lift)
    for remark in remarks:
        typer.echo(f"lapwing: warning: {remark}", err=True)
    airframe = f"--set vehicle.airframe={path}"
    typer.echo(
        f"next:\n  lapwing performance {path}\n  lapwing tune excitation {airframe} --out gains.toml\n"
        f"  lapwing run delivery_mission {airframe} --set autopilot.gains=gains.toml"
    )


def write_vehicle(
    name: str,
    measured: Values,
    folder: Path,
    ask: Ask | None = None,
    unitless: Collection[str] = (),
) -> tuple[Path, str, list[str]]:
    """Write an airframe. Return its path, a line about its thrust over weight, and warnings.

    Args:
        name: name of the vehicle.
        measured: values of `lapwing.cli.vehicle_measurements.FIGURES` by name.
        folder: folder that contains `vehicles`.
        ask: returns the measured value of a figure, None to accept the estimate; without `ask`, all are accepted. Its
            arguments are the figure, the estimate, and a function that raises ConfigError for a value that contradicts
            the ones before.
        unitless: names of the values given without a unit, which are rejected if another unit was probably meant.

    Raises:
        ValueError: an invalid or used name.
        ConfigError: an impossible value, or a vehicle that cannot hover; its key is the figure.
    """
    from lapwing.cli.airframe_writer import airframe_text
    from lapwing.cli.vehicle_estimates import WEAK, estimate
    from lapwing.services.common.schemas.run_schema import SHIPPED

    if not name.isidentifier() or name != name.lower():
        raise ValueError(f"NAME {name}: expected a name in small letters, for example my_quad")
    path = folder / "vehicles" / f"{name}.toml"
    if path.exists() or (SHIPPED / "vehicles" / f"{name}.toml").exists():
        raise ValueError(f"NAME {name}: a vehicle has this name; choose another")
    known, earlier = dict(measured), dict[str, float]()
    remarks: list[str] = []
    if ask:
        _lift(known)  # each answer is then checked with the ones before
    try:
        for figure in FIGURES:
            if ask and figure.name not in known:
                value = ask(figure, estimate(known)[figure.name], partial(_lift_with, dict(known), figure.name))
                known |= {} if value is None else {figure.name: value}
            elif figure.name in known:
                value, guess = known[figure.name], estimate(earlier)[figure.name]
                figure.check(value)
                if figure.name in unitless:
                    figure.check_unit(value, guess)
                remarks += filter(None, [figure.plausibility_question(value, guess)])
            earlier |= {figure.name: known[figure.name]} if figure.name in known else {}
        values = estimate(known)
        remarks += filter(None, [_overlap(values)])
        ratio, reason = _lift(known)
    except ConfigError as error:  # a remark about a unit may name the cause
        if not remarks:
            raise
        raise ConfigError(error.key, "; ".join([error.sentence, *remarks])) from None
    path.parent.mkdir(exist_ok=True)
    write_text(path, airframe_text(name, values, set(known)))
    lift = f"thrust over weight {ratio:.2f}, limited by {reason}"
    warning = f"its thrust is {ratio:.2f} times its weight; control authority is small below {WEAK:g}"
    return path, lift, [*remarks, warning] if ratio < WEAK else remarks


def _lift_with(known: Values, name: str, value: float) -> tuple[float, str]:
    return _lift({**known, name: value})


def _lift(known: Values) -> tuple[float, str]:
    """Return the thrust over weight of a vehicle with these figures, and what limits it.

    Raises:
        ConfigError: the figures contradict each other, or the vehicle cannot hover; its key is a figure.
    """
    from lapwing.cli.airframe_writer import airframe_of
    from lapwing.cli.vehicle_estimates import check_fit, estimate
    from lapwing.dynamics.constants import STANDARD_GRAVITY
    from lapwing.dynamics.vehicles.performance import limited_thrust

    values = estimate(known)
    frame = airframe_of(values)
    try:
        thrust, limit = limited_thrust(frame)
    except ValueError as error:
        electrics = ("no_load_current", "resistance", "esc_current", "peak_current", "c_rating", "speed_constant")
        raise ConfigError(next((name for name in electrics if name in known), "mass"), str(error)) from None
    ratio, (reason, causes) = thrust / (values["mass"] * STANDARD_GRAVITY), _limit(frame, limit)
    if ratio <= 1.0:
        cause = next((cause for cause in causes if cause in known), "mass")
        expected = f"more lift by {', '.join(causes)}, or less mass"
        raise ConfigError(cause, f"the thrust is {ratio:.2f} times the weight, limited by {reason}", expected)
    check_fit(known)
    return ratio, f"{reason} ({', '.join(causes)})"


def _limit(frame: "Airframe", limit: str) -> tuple[str, list[str]]:
    """Return what limits the thrust, and the figures that raise the limit."""
    motor, pack = frame.motor, frame.battery
    if limit == "voltage":
        return f"the {motor.max_voltage:.3g} V of the battery", ["speed_constant", "cells", "diameter"]
    if frame.motor_current_limit < motor.current_limit and pack:
        return f"the {pack.current_limit:.3g} A of the battery", ["capacity", "c_rating"]
    figure = "esc_current" if motor.current_limit == motor.esc_current else "peak_current"
    return f"the {motor.current_limit:.3g} A of the {'controller' if figure == 'esc_current' else 'motor'}", [figure]


def _overlap(v: Values) -> str:
    """Return a warning about propellers that overlap; "" if they do not."""
    apart = 2.0 * v["arm"] * math.sin(math.pi / v["rotors"])
    if v["diameter"] <= apart:
        return ""
    return f"diameter = {v['diameter']:.3g} m: the propellers overlap, their hubs are {apart:.3g} m apart"


class Interview:
    """Interview in a terminal. If it ends early, it prints a command that continues with the answers so far."""

    def __init__(self, name: str, values: dict[str, float]):
        self._name, self._answers, self._started = name, dict(values), False

    def ask(self, figure: Figure, guess: float, check: Callable[[float], object]) -> float | None:
        """Return the measured value of a figure that passes `check`, or None to accept the guess.

        Raises:
            ValueError: no user answers.
        """
        if not self._started:
            typer.echo("Enter leaves a value to an estimate that fits all answers, as in brackets so far; Ctrl-C ends.")
            self._started = True
        typer.echo(f"\n{figure.how}")
        while text := _answer(f"{figure.name}, {figure.unit} [{guess:.4g}]: "):
            try:
                value = figure.parse(text)
                check(value)
            except ValueError as error:
                typer.echo(error)
                continue
            question = figure.plausibility_question(value, guess)
            if not question or _answer(f"{question} [y/N] ").lower() in ("y", "yes"):
                self._answers[figure.name] = value
                return value
        return None

    def print_answers(self) -> None:
        """Print the command that continues the interview with the answers so far."""
        if self._started and self._answers:
            options = " ".join(f"--set {name}={value:.9g}" for name, value in self._answers.items())
            typer.echo(f"\nnothing is written; with these answers: lapwing new vehicle {self._name} {options}")


def _answer(question: str) -> str:
    try:
        return input(question).strip()
    except EOFError:
        raise ValueError("standard input has ended; run the interview in a terminal") from None
