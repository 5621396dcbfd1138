"""`lapwing new vehicle`: an interview about the measurements of a vehicle, and the airframe file from the answers."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.new_command import new
from lapwing.cosim.complete_file import write_text
from lapwing.cosim.processes.interrupt import Interrupted
from lapwing.dynamics.config_error import ConfigError

if TYPE_CHECKING:
    from lapwing.vehicle_measurements import Figure

WEAK = 1.4  # thrust-to-weight ratio below which control authority is small


@new.command()
def vehicle(
    name: Annotated[str, typer.Argument(metavar="NAME", help="name of the vehicle and of its file: my_quad")],
    measured: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="FIGURE=VALUE", help="measured value, e.g. mass=2.0; skips its question (repeatable)"
        ),
    ] = None,
) -> None:
    """Create an airframe: vehicles/NAME.toml, from measurements.

    In a terminal, the command asks for each measurement and explains it (see docs/guides/new_airframe.md). Elsewhere,
    measurements without --set are estimated from the others and marked as estimates in the file.
    """
    values = _parse_values(measured or [])
    interview = Interview(name, values) if sys.stdin.isatty() else None
    try:
        path, remarks = write_vehicle(name, values, Path(), interview.ask if interview else None)
    except (ValueError, Interrupted):
        if interview:
            interview.print_answers()
        raise
    typer.echo(path)
    for remark in remarks:
        typer.echo(f"lapwing: warning: {remark}", err=True)
    airframe_option = f"--set vehicle.airframe={path.resolve()}"
    typer.echo(
        f"next: lapwing performance {path}; lapwing tune excitation {airframe_option} --out gains.toml; "
        f"lapwing run hover {airframe_option} --set autopilot.gains={Path('gains.toml').resolve()}"
    )


def write_vehicle(
    name: str, measured: dict[str, float], folder: Path, ask: Callable[["Figure", float], float | None] | None = None
) -> tuple[Path, list[str]]:
    """Write an airframe. Return its path, and warnings about it.

    Args:
        name: name of the vehicle.
        measured: values of `lapwing.vehicle_measurements.FIGURES` by name.
        folder: folder that contains `vehicles`.
        ask: (figure, guess) -> measured value, None to accept the guess; without `ask`, all guesses are accepted.

    Raises:
        ValueError: an invalid or used name, an impossible value, or a vehicle that cannot hover.
    """
    from lapwing.airframe_writer import airframe_of, airframe_text
    from lapwing.dynamics.vehicles.performance import thrust_over_weight
    from lapwing.services.common.run_schema import SHIPPED
    from lapwing.vehicle_measurements import FIGURES

    if not name.isidentifier() or name != name.lower():
        raise ValueError(f"NAME {name}: expected a name in small letters, for example my_quad")
    path = folder / "vehicles" / f"{name}.toml"
    if path.exists() or (SHIPPED / "vehicles" / f"{name}.toml").exists():
        raise ValueError(f"NAME {name}: a vehicle has this name; choose another")
    values: dict[str, float] = {}
    own = set(measured)
    remarks: list[str] = []
    for figure in FIGURES:
        guess = figure.guess(values)
        if figure.name in measured:
            value: float | None = measured[figure.name]
            remarks += filter(None, [figure.plausibility_question(measured[figure.name], guess)])
        elif (value := ask(figure, guess) if ask else None) is not None:
            own.add(figure.name)
        values[figure.name] = guess if value is None else value
        figure.check(values[figure.name])
    try:
        thrust_to_weight = thrust_over_weight(airframe_of(values))
        if thrust_to_weight <= 1.0:
            raise ValueError(
                f"{name} cannot hover: its thrust is {thrust_to_weight:.2f} times its weight; expected more than 1"
            )
    except ValueError as error:  # a remark about a unit may name the cause
        raise ValueError("; ".join([str(error), *remarks])) from None
    path.parent.mkdir(exist_ok=True)
    write_text(path, airframe_text(name, values, own))
    warning = f"its thrust is {thrust_to_weight:.2f} times its weight; control authority is small below {WEAK:g}"
    return path, [*remarks, warning] if thrust_to_weight < WEAK else remarks


class Interview:
    """Interview in a terminal. If it ends early, it prints a command that continues with the answers so far."""

    def __init__(self, name: str, values: dict[str, float]):
        self._name, self._answers, self._started = name, dict(values), False

    def ask(self, figure: "Figure", guess: float) -> float | None:
        """Return the measured value of a figure, or None to accept the guess.

        Raises:
            ValueError: no user answers.
        """
        if not self._started:
            typer.echo("Enter accepts the value in brackets, an estimate from the previous answers; Ctrl-C ends.")
            self._started = True
        typer.echo(f"\n{figure.how}")
        while text := _answer(f"{figure.name}, {figure.unit} [{guess:.4g}]: "):
            try:
                value = float(text)
            except ValueError:
                typer.echo(f"{figure.name}: expected a number in {figure.unit} alone, as {guess:.4g}, got {text!r}")
                continue
            try:
                figure.check(value)
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


def _parse_values(measured: list[str]) -> dict[str, float]:
    """Return figures by name from texts FIGURE=VALUE."""
    from lapwing.vehicle_measurements import FIGURES

    names, result = [figure.name for figure in FIGURES], {}
    for text in measured:
        name, _, value = (part.strip() for part in text.partition("="))
        if name not in names:
            raise ConfigError.unknown(f"--set {text}", "figure", name, names)
        try:
            result[name] = float(value)
        except ValueError:
            raise ConfigError(f"--set {text}", f"got {value!r}", "a number") from None
    return result
