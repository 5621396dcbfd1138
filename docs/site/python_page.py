"""Parts of the reference page of Python: signatures, fields and docstrings of the public names."""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from typing import Any

import lapwing
from lapwing import plugins
from lapwing.dynamics.effects import _hooks
from lapwing.flights.topic_view import TopicView
from lapwing.gym import DroneVectorEnv
from lapwing.services.autopilot.custom import estimator_api
from lapwing.services.common import controller_api

INTRODUCTION = """`import lapwing` provides the names below, with type hints. Arrays are numpy arrays in SI units;
the name of a vector ends with its frame ([Frames and units](frames.md)). The series of a flight are
[topics](topics.md). An invalid scene, key or value raises `lapwing.SceneError`, a `ValueError` of one line."""
SECTIONS = {
    "Fly": ("fly", "load_scene", "read_log", "campaign", "Flight", "TopicView", "FlightOutcome", "Event"),
    "Step": ("Simulator", "Observation", "Setpoint", "BatchSimulator", "BatchState"),
    "Distributions": ("normal", "lognormal", "uniform", "loguniform", "choice", "linspace", "posterior"),
    "Gymnasium": ("DroneVectorEnv",),
    "Scenes and errors": ("Scene", "SceneError", "LockStepError"),
    "Controllers": ("VehicleModel", "TrueState", "StateEstimate", "ThrustAndMoments", "MotorVoltages"),
    "Estimators": (
        *("ImuReading", "GpsReading", "BarometerReading", "MagnetometerReading", "DistanceReading"),
        *("OpticalFlowReading", "AirspeedReading", "BatteryReading"),
    ),
    "Effects and sensors": (
        *("EffectInputs", "Motion", "Air", "Rotors", "Loads", "Factors", "MassProperties", "Truth", "OtherVehicle"),
    ),
}
NOTES = {
    "Gymnasium": "`lapwing.gym` registers `Hover-v0`, `Track-v0`, `Land-v0` and `Race-v0`; `gymnasium.make` and "
    "`gymnasium.make_vec` take these arguments ([example](../tutorials/first_flight.md#step-many-vehicles)).",
    "Controllers": f"{controller_api.__doc__}\n"
    "`lapwing new controller NAME` writes an example ([tutorial](../tutorials/first_flight.md#write-a-controller)).",
    "Estimators": f"{estimator_api.__doc__}\n`Observation.sensors` of a `Simulator` has the same readings.",
    "Effects and sensors": "`lapwing new effect NAME` and `lapwing new sensor NAME` write examples ([Your own modules]"
    f"(../guides/extensions.md)). Names are imported from `lapwing.plugins`.\n\n{_hooks.__doc__}",
}
ELSEWHERE = {"TopicView": TopicView, "DroneVectorEnv": DroneVectorEnv}
INTERNAL = {  # members for other packages of Lapwing
    *("of", "of_each", "located", "mission", "occurrences", "contacts", "neighbours", "payloads", "origin"),
    *("advance_under_rates", "run_blocks", "restart", "level_ground", "memory"),
    *("cached", "replaced", "each_vehicle", "with_vehicles", "section", "tables", "has_all"),
    *("is_end", "mark", "succeeded"),
}
_HEADINGS = ("Args:", "Attributes:", "Raises:")


def parts() -> Iterator[str]:
    """Yield the parts of the page."""
    yield "# Python"
    yield INTRODUCTION
    yield "\n".join(
        f"- {section}: {', '.join(f'[{n}](#{n.lower()})' for n in SECTIONS[section])}" for section in SECTIONS
    )
    for section, names in SECTIONS.items():
        yield f"## {section}"
        yield inspect.cleandoc(NOTES.get(section, ""))
        for name in names:
            yield f"### {name}"
            module = lapwing if name in lapwing.__all__ else plugins
            value = ELSEWHERE.get(name) or getattr(module, name)
            yield from _class(name, value) if isinstance(value, type) else _function(value)


def _function(function: Any) -> Iterator[str]:
    yield _python(_signature(function))
    yield _markdown(function.__doc__)


def _class(name: str, cls: type) -> Iterator[str]:
    fields = _fields(cls)
    constructor = "" if fields or issubclass(cls, Exception) or name in ("Flight", "TopicView", "Scene") else "__init__"
    if constructor:
        yield _python(_signature(vars(cls)[constructor], name))
    yield _markdown(cls.__doc__ or "")
    if constructor:
        yield _markdown((vars(cls)[constructor].__doc__ or "").partition("\n\n")[2])
    if fields:
        yield _python(fields)
    members = {
        key: member
        for base in reversed(cls.__mro__)
        if base.__module__.startswith("lapwing.")
        for key, member in vars(base).items()
        if not key.startswith("_") and key not in INTERNAL
    }
    values = {key: _getter(member) for key, member in members.items() if _getter(member)}
    if values and not fields:
        rows = (
            f"| `{key}` | `{_returned(get)}` | {' '.join(get.__doc__.partition('Raises:')[0].split())} |"
            for key, get in sorted(values.items())
        )
        yield "\n".join(["| attribute | type | meaning |", "|---|---|---|", *rows])
    for key, method in sorted(members.items()):
        function = method.__func__ if isinstance(method, classmethod) else method
        if inspect.isfunction(function) and not issubclass(cls, Exception):
            yield f"#### {name}.{key}"
            yield _python(_signature(function))
            yield _markdown(function.__doc__ or "")


def _getter(member: Any) -> Any:
    return member.fget if isinstance(member, property) else getattr(member, "func", None)


def _node(value: Any) -> tuple[Any, list[str]]:
    source = textwrap.dedent(inspect.getsource(value))
    return ast.parse(source).body[0], source.splitlines()


def _signature(function: Any, constructed: str = "") -> str:
    node, lines = _node(function)
    text = "\n".join(lines[node.lineno - 1 : node.body[0].lineno - 1]).rstrip(":")
    return re.sub(r"def __init__\((\s*)self,\s*", rf"{constructed}(\1", text) if constructed else text


def _returned(function: Any) -> str:
    node, _ = _node(function)
    return ast.unparse(node.returns).strip("'").replace("|", "\\|")


def _fields(cls: type) -> str:
    """Return the fields of a NamedTuple with their comments; "" for another class."""
    if not hasattr(cls, "_fields"):
        return ""
    node, lines = _node(cls)
    fields = [entry for entry in node.body if isinstance(entry, ast.AnnAssign)]
    return textwrap.dedent("\n".join("\n".join(lines[f.lineno - 1 : f.end_lineno]) for f in fields))


def _python(code: str) -> str:
    return f"```python\n{code}\n```"


def _markdown(docstring: str) -> str:
    """Return a docstring in Google's style as Markdown."""
    result = []
    for paragraph in inspect.cleandoc(docstring).split("\n\n"):
        heading, _, rest = paragraph.partition("\n")
        if heading in _HEADINGS:
            entries = [" ".join(entry.split()) for entry in re.split(r"\n(?=\S)", textwrap.dedent(rest))]
            lists = [re.sub(r"^([\w*]+): ", r"- `\1`: ", entry) for entry in entries]
            paragraph = "\n".join([*([] if heading == "Args:" else [f"{heading}\n"]), *lists])
        elif heading == "Returns:":
            paragraph = f"Returns: {' '.join(rest.split())}"
        result.append(paragraph)
    return "\n\n".join(result)
