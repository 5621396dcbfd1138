"""`lapwing new vehicle`: asks for what must be measured, and writes an airframe."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.errors import user_errors
from lapwing.cli.new import new

WEAK = 1.4  # thrust over weight below which too little is left for control


@new.command()
def vehicle(
    name: Annotated[str, typer.Argument(metavar="NAME", help="of the vehicle and of its file: my_quad")],
    measured: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIGURE=VALUE", help="a figure instead of a question: mass=2.0 (repeatable)"),
    ] = None,
) -> None:
    """An airframe of your own: vehicles/NAME.toml in this folder, from figures that a workshop can measure.

    In a terminal it asks for each figure and says how to measure it (docs/new_airframe.md has more); elsewhere, figures
    that are not given with --set are guessed from the others, and marked so in the file.
    """
    with user_errors():
        given = _given(measured or [])
        path, remarks = write_vehicle(name, given, Path(), _ask if sys.stdin.isatty() else None)
        typer.echo(path)
        for remark in remarks:
            typer.echo(f"lapwing: warning: {remark}", err=True)
        here = f"--set vehicle.airframe={path.resolve()}"
        typer.echo(
            f"next: lapwing performance {path}; lapwing tune excitation {here} --out gains.toml; "
            f"lapwing run hover {here} --set autopilot.gains={Path('gains.toml').resolve()}"
        )


def write_vehicle(
    name: str, given: dict[str, float], folder: Path, ask: Callable[[str, float, str], float] | None = None
) -> tuple[Path, list[str]]:
    """Write an airframe; (its path, what is to be said of it).

    Args:
        name: of the vehicle.
        given: figures of `lapwing.vehicle_figures.FIGURES` by name.
        folder: in whose folder `vehicles` it is written.
        ask: (name and unit, guess, how to measure it) -> the figure; None: guesses are taken.

    Raises:
        ValueError: not a name, one that is taken, a figure that cannot be, or a vehicle that cannot hover.
    """
    from dynamics.vehicles.performance import thrust_over_weight
    from lapwing.vehicle_figures import FIGURES
    from lapwing.vehicle_file import airframe_of, written
    from services.common.sections import SHIPPED

    if not name.isidentifier() or name != name.lower():
        raise ValueError(f"NAME {name}: expected a name in small letters, for example my_quad")
    path = folder / "vehicles" / f"{name}.toml"
    if path.exists() or (SHIPPED / "vehicles" / f"{name}.toml").exists():
        raise ValueError(f"NAME {name}: a vehicle has this name; choose another")
    values: dict[str, float] = {}
    for figure in FIGURES:
        guess = figure.guess(values)
        if figure.name in given:
            values[figure.name] = given[figure.name]
        else:
            values[figure.name] = ask(f"{figure.name} [{figure.unit}]", guess, figure.how) if ask else guess
        figure.check(values[figure.name])
    frame = airframe_of(values)
    reserve = thrust_over_weight(frame)
    if reserve <= 1.0:
        raise ValueError(f"{name} cannot hover: its thrust is {reserve:.2f} times its weight; expected more than 1")
    path.parent.mkdir(exist_ok=True)
    known = set(given) if ask is None else set(values)
    path.write_text(written(name, values, known), encoding="utf-8")
    weak = f"its thrust is {reserve:.2f} times its weight; below {WEAK:g} too little is left for control"
    return path, [weak] if reserve < WEAK else []


def _ask(question: str, guess: float, how: str) -> float:
    typer.echo(f"\n{how}")
    answer: float = typer.prompt(question, default=float(f"{guess:.3g}"), type=float)
    return answer


def _given(measured: list[str]) -> dict[str, float]:
    """Figures by name, of texts FIGURE=VALUE."""
    from dynamics.errors import KeyedError
    from lapwing.vehicle_figures import FIGURES

    names, found = [figure.name for figure in FIGURES], {}
    for text in measured:
        name, _, value = (part.strip() for part in text.partition("="))
        if name not in names:
            raise KeyedError.unknown(f"--set {text}", "figure", name, names)
        try:
            found[name] = float(value)
        except ValueError:
            raise KeyedError(f"--set {text}", f"got {value!r}", "a number") from None
    return found
