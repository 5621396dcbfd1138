"""The API reference in Markdown, made from signatures and docstrings."""

import inspect
import re
import types
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import lapwing
from lapwing.docs.markdown import table
from lapwing.dynamics.field_comments import comments, split
from lapwing.messages.topics import TOPICS
from lapwing.services.common import controller_api, estimator_api, ports
from lapwing.studies.topic_view import TopicView

HEAD = """\
# API reference

Made from the code by `lapwing docs api --out docs/api.md`. The [tutorial](tutorial.md) shows all of it at work; keys of
scenes are in [reference.md](reference.md).

Units are SI throughout: m, s, rad, kg, N, V. `_world` is east, north, up; `_body` is forward, left, up. Quaternions
take body to world; they are (w, x, y, z) in tuples, and (x, y, z, w) in messages ([frames.md](frames.md)). Arrays are
numpy's, and their first axis is time.

Whatever a user can mend is a `lapwing.SceneError` or another `ValueError` of one line: where, which key, what is wrong,
what would be right. How a flight ended is its `Flight.verdict`.
"""

TOPICS_HEAD = """\
`flight.topic(NAME)`, for some also `flight.NAME`. The fields of a message type are those of its `.msg` file in
[messages/msg](../messages/msg), SI. A sensor of the user's own has the topic `own_sensor/NAME`, by its name in the
scene."""

CONTROLLER = """\
Named in a scene, or given to `lapwing.fly(scene, controller=MyController, controller_options={"stiffness": 4.0})`.
[examples](../examples) has a linear-quadratic regulator and a geometric controller on SE(3)."""

ESTIMATOR = """\
Named in a scene, or given to `lapwing.fly(scene, estimator=MyEstimator)`."""

SECTION = re.compile(r"^(Args|Returns|Raises|Attributes|Yields):$")
FUNCTIONS = ("load", "fly", "read", "campaign", "normal", "uniform", "loguniform", "linspace", "choice")
CLASSES = (
    *("Flight", "Verdict", "Event", "Simulator", "Observation", "Batch", "BatchState"),
    *("Scene", "SceneError", "LockStepError"),
)
SHOWN = {  # of classes that have more than what a user calls
    "Flight": (
        *("rmse", "errors", "reference", "armed", "verdict", "events", "landed", "finished"),
        *("energy", "truth", "estimate", "setpoint"),
        *("actuators", "status", "topics", "setup", "metadata", "digest"),
        *("topic", "has", "times", "to_dataframe", "save", "report", "plot"),
    ),
    "Scene": ("name", "path", "overrides", "resolved", "lookup"),
    "SceneError": ("sentence",),
    "LockStepError": (),
}
VIEW = ("times", "stamps", "position", "orientation", "attitude", "fields", "flat")
READINGS = (
    *(ports.ImuReading, ports.MagnetometerReading, ports.GpsReading, ports.BarometerReading),
    *(ports.DistanceReading, ports.OpticalFlowReading),
)


def api() -> str:
    """The page docs/api.md: the Python interface (Markdown)."""
    chapters = {
        "Functions": [_function(f"lapwing.{name}", getattr(lapwing, name)) for name in FUNCTIONS],
        "Classes": [*(_class(f"lapwing.{name}", getattr(lapwing, name), SHOWN.get(name)) for name in CLASSES)],
        "Topics of a flight": [_class("TopicView", TopicView, VIEW), TOPICS_HEAD, _topics()],
        "Your own controller": [CONTROLLER, _prose(inspect.getdoc(controller_api)), *_tuples(controller_api)],
        "Your own estimator": [ESTIMATOR, _prose(inspect.getdoc(estimator_api)), *map(_fields_of, READINGS)],
    }
    contents = "\n".join(f"- [{title}](#{title.lower().replace(' ', '-')})" for title in chapters)
    body = "\n\n".join(f"## {title}\n\n" + "\n\n".join(parts) for title, parts in chapters.items())
    return f"{HEAD}\n{contents}\n\n{body}\n"


def _tuples(module: types.ModuleType) -> Iterator[str]:
    """The NamedTuples that a module hands on."""
    for name in module.__all__:
        yield _fields_of(getattr(module, name))


def _fields_of(cls: type) -> str:
    return f"### {cls.__name__}\n\n{_prose(inspect.getdoc(cls))}\n\n{_fields(cls)}"


def _fields(cls: type) -> str:
    """The fields of a NamedTuple: type, unit, default, meaning."""
    said, hints = comments(cls), inspect.get_annotations(cls)
    defaults = cls._field_defaults  # type: ignore[attr-defined]
    rows = []
    for name in cls._fields:  # type: ignore[attr-defined]
        unit, meaning = split(said.get(name, ""))
        default = f"`{_plain(defaults[name])}`" if name in defaults else ""
        rows.append([f"`{name}`", f"`{_type(hints[name])}`", unit, default, meaning])
    return table(["field", "type", "unit", "default", "meaning"], rows)


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, tuple) else value


def _type(hint: Any) -> str:
    """An annotation as a reader would write it."""
    text = inspect.formatannotation(hint)
    text = re.sub(r"\b(?:[a-z_][A-Za-z_0-9]*\.)+(?=[A-Za-z])", "", text)
    return text.replace("tuple[float, float, float]", "Vec3").replace("ndarray", "np.ndarray").replace("'", "")


def _signature(name: str, function: Any, method: bool) -> str:
    signature = inspect.signature(function)
    parameters = [p for k, p in enumerate(signature.parameters.values()) if not (method and k == 0)]
    texts: list[str] = []
    starred = False
    for p in parameters:
        if p.kind is p.KEYWORD_ONLY and not starred:
            texts, starred = [*texts, "*"], True
        mark = "*" if p.kind is p.VAR_POSITIONAL else ""
        hint = "" if p.annotation is p.empty else f": {_type(p.annotation)}"
        default = "" if p.default is p.empty else f" = {p.default!r}"
        texts.append(f"{mark}{p.name}{hint}{default}")
    back = signature.return_annotation
    made = method and not name.startswith(".")  # `__init__`, by the name of its class
    returned = "" if back in (signature.empty, None) or made else f" -> {_type(back)}"
    line = f"{name}({', '.join(texts)}){returned}"
    if len(line) > 110:
        line = f"{name}(\n    " + ",\n    ".join(texts) + f",\n){returned}"
    return f"```python\n{line}\n```"


def _function(name: str, function: Any) -> str:
    return f"### {name}\n\n{_signature(name, function, False)}\n\n{_prose(inspect.getdoc(function))}"


def _class(name: str, cls: type, shown: Iterable[str] | None = None) -> str:
    """A class: what it says of itself, how it is made, its attributes and methods."""
    parts = [f"### {name}", _prose(inspect.getdoc(cls))]
    if hasattr(cls, "_fields"):
        return "\n\n".join([*parts, _fields(cls)])
    if name == "lapwing.Simulator":
        parts += [_signature(name, cls.__init__, True), _prose(inspect.getdoc(cls.__init__))]  # type: ignore[misc]
    chosen = [n for n in _members(cls) if not n.startswith("_")] if shown is None else list(shown)
    rows, methods = [], []
    for member in chosen:
        found = inspect.getattr_static(cls, member, None)
        if isinstance(found, property | cached_property):
            getter = found.fget if isinstance(found, property) else found.func
            rows.append([f"`{member}`", f"`{_type(inspect.signature(getter).return_annotation)}`", _line(found)])  # type: ignore[arg-type]
        elif found is not None:
            bound = found.__func__ if isinstance(found, classmethod) else found
            methods.append(f"{_signature(f'.{member}', bound, True)}\n\n{_prose(inspect.getdoc(bound))}")
    return "\n\n".join([*parts, *([table(["attribute", "type", "meaning"], rows)] if rows else []), *methods])


def _members(cls: type) -> list[str]:
    """The public names of a class and of those that it stands on here, in the order in which they are written."""
    own = [c for c in reversed(cls.__mro__) if c.__module__.split(".")[0] == "lapwing"]
    return list(dict.fromkeys(name for c in own for name in vars(c)))


def _line(thing: Any) -> str:
    """A docstring of a property on one line; what it raises behind it."""
    said = inspect.getdoc(thing) or ""
    text, _, raised = said.partition("Raises:")
    faults = f" Raises {' '.join(raised.split()).replace(': ', ' where: ', 1)}" if raised else ""
    return f"{' '.join(text.split())}{faults}"


def _prose(said: str | None) -> str:
    """A docstring in Markdown: its sections as lists, indented examples as code."""
    out: list[str] = []
    section, code = "", False
    for line in (said or "").splitlines():
        if found := SECTION.match(line):
            section = found[1]
            out += [f"*{section.lower().replace('args', 'arguments')}*", ""]
        elif section and line.startswith("    ") and not line.startswith("     "):
            name, colon, rest = line.strip().partition(": ")
            listed = colon and re.fullmatch(r"[A-Za-z_]\w*", name)
            out.append(f"- `{name}`: {rest}" if listed else f"{' ' if out[-1] else '-'} {line.strip()}")
        elif section and line.strip():
            out.append(f"  {line.strip()}")
        elif line.startswith("    ") and not section:
            if not code:
                code = True
                out.append("```")
            out.append(line[4:])
        else:
            if code and line.strip():
                while out and not out[-1]:
                    out.pop()
                code = False
                out += ["```", ""]
            section = "" if line.strip() else section
            out.append(line)
    if code:
        out.append("```")
    return "\n".join(out).rstrip()


def _topics() -> str:
    rows = []
    for topic in TOPICS:
        if topic.recorded:
            rate = f"`{topic.rate}`" if topic.rate else "`exchange.rate`"
            name = topic.name.removeprefix("{vehicle}/")
            rows.append([f"`{name}`", f"`{topic.message.__name__}`", rate])
    return table(["topic", "message", "rate"], rows)
