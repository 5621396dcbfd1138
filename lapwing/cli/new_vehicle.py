"""`lapwing new vehicle`: asks for what must be measured, and writes an airframe."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lapwing.cli.error_exit import user_errors
from lapwing.cli.new_command import new
from lapwing.cosim.processes.interrupt import Interrupted
from lapwing.dynamics.config_error import ConfigError

if TYPE_CHECKING:
    from lapwing.vehicle_measurements import Figure

WEAK = 1.4  # thrust over weight below which too little is left for control


@new.command()
def vehicle(
    name: Annotated[str, typer.Argument(metavar="NAME", help="of the vehicle and of its file: my_quad")],
    measured: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIGURE=VALUE", help="a figure instead of a question: mass=2.0 (repeatable)"),
    ] = None,
) -> None:
    """Create an airframe, vehicles/NAME.toml in this folder, from figures that a workshop can measure.

    In a terminal it asks for each figure and says how to measure it (docs/guides/new_airframe.md has more);
    elsewhere, figures
    that are not given with --set are guessed from the others, and marked so in the file.
    """
    with user_errors():
        given = _given(measured or [])
        interview = Interview(name, given) if sys.stdin.isatty() else None
        try:
            path, remarks = write_vehicle(name, given, Path(), interview.ask if interview else None)
        except (ValueError, Interrupted):
            if interview:
                interview.tell()
            raise
        typer.echo(path)
        for remark in remarks:
            typer.echo(f"lapwing: warning: {remark}", err=True)
        here = f"--set vehicle.airframe={path.resolve()}"
        typer.echo(
            f"next: lapwing performance {path}; lapwing tune excitation {here} --out gains.toml; "
            f"lapwing run hover {here} --set autopilot.gains={Path('gains.toml').resolve()}"
        )


def write_vehicle(
    name: str, given: dict[str, float], folder: Path, ask: Callable[["Figure", float], float | None] | None = None
) -> tuple[Path, list[str]]:
    """Write an airframe; (its path, what is to be said of it).

    Args:
        name: of the vehicle.
        given: figures of `lapwing.vehicle_measurements.FIGURES` by name.
        folder: in whose folder `vehicles` it is written.
        ask: (figure, guess) -> what was measured, None where the guess will do; None: guesses are taken.

    Raises:
        ValueError: not a name, one that is taken, a figure that cannot be, or a vehicle that cannot hover.
    """
    from lapwing.airframe_writer import airframe_of, written
    from lapwing.dynamics.vehicles.performance import thrust_over_weight
    from lapwing.services.common.run_schema import SHIPPED
    from lapwing.vehicle_measurements import FIGURES

    if not name.isidentifier() or name != name.lower():
        raise ValueError(f"NAME {name}: expected a name in small letters, for example my_quad")
    path = folder / "vehicles" / f"{name}.toml"
    if path.exists() or (SHIPPED / "vehicles" / f"{name}.toml").exists():
        raise ValueError(f"NAME {name}: a vehicle has this name; choose another")
    values: dict[str, float] = {}
    known = set(given)
    remarks: list[str] = []
    for figure in FIGURES:
        guess = figure.guess(values)
        if figure.name in given:
            value: float | None = given[figure.name]
            remarks += filter(None, [figure.doubt(given[figure.name], guess)])
        elif (value := ask(figure, guess) if ask else None) is not None:
            known.add(figure.name)
        values[figure.name] = guess if value is None else value
        figure.check(values[figure.name])
    reserve = thrust_over_weight(airframe_of(values))
    if reserve <= 1.0:
        raise ValueError(f"{name} cannot hover: its thrust is {reserve:.2f} times its weight; expected more than 1")
    path.parent.mkdir(exist_ok=True)
    path.write_text(written(name, values, known), encoding="utf-8")
    weak = f"its thrust is {reserve:.2f} times its weight; below {WEAK:g} too little is left for control"
    return path, [*remarks, weak] if reserve < WEAK else remarks


class Interview:
    """Asks in a terminal for one figure after the other; what was answered is not lost when it ends early."""

    def __init__(self, name: str, given: dict[str, float]):
        self._name, self._answers, self._begun = name, dict(given), False

    def ask(self, figure: "Figure", guess: float) -> float | None:
        """Return the measured value of a figure; None to accept the guess.

        Raises:
            ValueError: no user answers.
        """
        if not self._begun:
            typer.echo("Enter takes the value in brackets, a guess from the figures before it; Ctrl-C ends.")
            self._begun = True
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
            doubt = figure.doubt(value, guess)
            if not doubt or _answer(f"{doubt} [y/N] ").lower() in ("y", "yes"):
                self._answers[figure.name] = value
                return value
        return None

    def tell(self) -> None:
        """Return the answers so far as the start of the next interview."""
        if self._begun and self._answers:
            given = " ".join(f"--set {name}={value:.9g}" for name, value in self._answers.items())
            typer.echo(f"\nnothing is written; with these answers: lapwing new vehicle {self._name} {given}")


def _answer(question: str) -> str:
    try:
        return input(question).strip()
    except EOFError:
        raise ValueError("standard input has ended; run the interview in a terminal") from None


def _given(measured: list[str]) -> dict[str, float]:
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
