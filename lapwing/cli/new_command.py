"""`lapwing new`: templates of scenes, airframes and extensions."""

from pathlib import Path
from string import Template
from typing import Annotated

import typer

from lapwing.cli.app import app

new = typer.Typer(help="Create a scene, airframe, effect or other extension.", rich_markup_mode=None)
app.add_typer(new, name="new")

TEMPLATES = Path(__file__).parent / "templates"
EXTENSIONS = {  # kinds of extensions, and what their commands create
    "controller": "a controller",
    "estimator": "an estimator",
    "sensor": "a sensor",
    "effect": "an effect",
    "segment": "a trajectory segment",
}
ModuleName = Annotated[str, typer.Argument(metavar="NAME", help="name of the module, e.g. tether_drag")]


@new.command()
def scene(name: Annotated[str, typer.Argument(metavar="NAME", help="name of the scene, e.g. my_flight")]) -> None:
    """Create a scene: NAME.toml, over waypoints."""
    path = write_scene(name, Path())
    typer.echo(f"{path}\nnext:\n  lapwing check {path}\n  lapwing run {path} --view")


def _register(kind: str, noun: str) -> None:
    """Register the command that creates an extension of this kind."""

    @new.command(kind, help=f"Create {noun}: NAME.py and test_NAME.py.")
    def create(name: ModuleName) -> None:
        for path in write_module(kind, name, Path()):
            typer.echo(path)


for _kind, _noun in EXTENSIONS.items():
    _register(_kind, _noun)


def write_scene(name: str, folder: Path) -> Path:
    """Write a commented scene and return its path. Raise ValueError for an invalid or taken name."""
    from lapwing.services.common.schemas.run_schema import SHIPPED

    if not name.isidentifier():
        raise ValueError(f"NAME {name}: expected letters, digits and _, and no digit first, e.g. my_flight")
    if (SHIPPED / f"{name}.toml").exists():
        raise ValueError(f"NAME {name}: is a shipped scene; choose another name, e.g. my_flight")
    path = folder / f"{name}.toml"
    if path.exists():
        raise ValueError(f"{path}: already exists; choose another name")
    text = Template((TEMPLATES / "scene.toml.template").read_text(encoding="utf-8"))
    path.write_text(text.substitute(name=name, title=f"{name.replace('_', ' ')}: a first flight"), encoding="utf-8")
    return path


def write_module(kind: str, name: str, folder: Path) -> list[Path]:
    """Write a working extension and its test. Return their paths.

    Raises:
        ValueError: the name is invalid or taken, or a file exists.
    """
    from lapwing.cosim.config.user_module import installed_module
    from lapwing.dynamics import effects
    from lapwing.services.sensors import schema
    from lapwing.services.trajectory.segments import KINDS

    cls = effects.class_name(name)
    if not name.isidentifier() or name != name.lower() or cls == name:
        raise ValueError(f"NAME {name}: expected a name in small letters, e.g. tether_drag")
    paths = [folder / f"{name}.py", folder / f"test_{name}.py"]
    for path in paths:
        if path.exists():
            raise ValueError(f"{path}: already exists; choose another name")
    if name in {*effects.names(), *schema.sensors(), *KINDS} or installed_module(name):
        raise ValueError(f"NAME {name}: an effect, sensor, segment or module has this name; choose another")
    for path, text in zip(paths, templates(kind, name), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


def templates(kind: str, name: str) -> tuple[str, str]:
    """Return the texts of an extension and of its test."""
    from lapwing.dynamics import effects

    names = {"name": name, "cls": effects.class_name(name)}
    files = [TEMPLATES / f"{kind}{suffix}.py.template" for suffix in ("", "_test")]
    module, test = (Template(file.read_text(encoding="utf-8")).substitute(names) for file in files)
    return module, test
