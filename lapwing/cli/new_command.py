"""`lapwing new`: files to begin with."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors

new = typer.Typer(help="Create a scene, airframe, effect or other extension.", rich_markup_mode=None)
app.add_typer(new, name="new")

EFFECT = '''"""Linear air drag: an effect of your own.

A scene beside this file calls for it with

    [effects.{name}]
    module = "{name}"
    coefficient = 0.5
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge

from lapwing.dynamics.effects._hooks import wrench  # what else an effect may do: the docstring of that module
from lapwing.dynamics.vector import ZERO, scale, subtract


class {cls}(NamedTuple):
    """What the scene's table may say; each key is checked against its annotation."""

    coefficient: Annotated[float, Ge(0)] = 0.5  # [N s/m]


@wrench({cls})
def {name}(e, memory, s, rotors):
    """Force [N] in world coordinates and torque [N m] in body coordinates, at the centre of mass.

    Args:
        e: {cls}.
        memory: of this effect, () without `initial_memory`.
        s: Situation: s.t [s], s.motion, s.air and more (lapwing/dynamics/effects/_types.py).
        rotors: thrust, torque and current of each rotor.
    """
    airspeed_world = subtract(s.motion.velocity_world, s.air.wind_world)
    return scale(-e.coefficient, airspeed_world), ZERO
'''

EFFECT_TEST = '''"""Tests of the effect {name}."""

from pathlib import Path
from types import SimpleNamespace

import lapwing
import pytest
from lapwing.kernels import python_function


@pytest.fixture(autouse=True)
def beside(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent)


def fly(coefficient):
    effect = {{"effects.{name}.module": "{name}", "effects.{name}.coefficient": coefficient}}
    return lapwing.fly("hover", {{**effect, "effects.wind_constant.velocity": [5.0, 0.0, 0.0]}})


def test_the_force_is_against_the_airspeed():
    from {name} import {cls}, {name}

    s = SimpleNamespace(
        motion=SimpleNamespace(velocity_world=(1.0, 0.0, 0.0)), air=SimpleNamespace(wind_world=(0.0, 2.0, 0.0))
    )
    force_world, torque_body = python_function({name})({cls}(0.5), (), s, None)
    assert force_world == (-0.5, 1.0, 0.0)
    assert torque_body == (0.0, 0.0, 0.0)


def test_the_wind_blows_the_vehicle_off():
    assert fly(2.0).rmse["x"] > 10.0 * fly(0.0).rmse["x"]


def test_a_negative_coefficient_is_refused():
    with pytest.raises(lapwing.SceneError, match="effects.{name}.coefficient"):
        fly(-1.0)
'''


@new.command()
def effect(
    name: Annotated[str, typer.Argument(metavar="NAME", help="of the effect and of its file: tether_drag")],
) -> None:
    """An effect of your own: NAME.py and test_NAME.py in this folder."""
    with user_errors():
        for path in write_effect(name, Path()):
            typer.echo(path)


def write_effect(name: str, folder: Path) -> list[Path]:
    """Write an effect that works and its test; their paths.

    Raises:
        ValueError: not a name, one that is taken, or a file is there already.
    """
    from lapwing.cosim.config.user_module import installed_module
    from lapwing.dynamics import effects

    cls = effects.class_name(name)
    if not name.isidentifier() or name != name.lower() or cls == name:
        raise ValueError(f"NAME {name}: expected a name in small letters, for example tether_drag")
    files = {folder / f"{name}.py": EFFECT, folder / f"test_{name}.py": EFFECT_TEST}
    for path in files:
        if path.exists():
            raise ValueError(f"{path}: is there already; choose another name")
    if name in effects.names() or installed_module(name):
        raise ValueError(f"NAME {name}: an effect or a module has this name; choose another")
    for path, text in files.items():
        path.write_text(text.format(name=name, cls=cls), encoding="utf-8")
    return list(files)
