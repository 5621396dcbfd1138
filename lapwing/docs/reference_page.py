"""The scene reference: every key of scenes, airframes and gain sets, in Markdown."""

import inspect
from collections.abc import Iterator
from types import ModuleType
from typing import Any, get_args

from lapwing.cosim.scene import SceneTable
from lapwing.docs.catalogue import effect_tables, flight_parameters, sensor_tables
from lapwing.docs.key_docs import first_sentence, is_table, keys
from lapwing.docs.markdown import key_table, number, table
from lapwing.dynamics import effects, integrators
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.services.autopilot import gains
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.plant import models
from lapwing.services.scene_resolver import vocabulary
from lapwing.services.sensors.fault_schedule import SLOTS, FaultTable
from lapwing.services.trajectory.phases import Phase
from lapwing.services.trajectory.segments import KINDS

HEAD = """\
# Scene reference

Made from the code by `lapwing docs reference --out docs/reference.md`: types, bounds and defaults are those that the
loader checks, units and meanings are the comments behind the fields.

A scene is a TOML file; every key of it can be overridden by `--set KEY=VALUE` (`--set effects.wind_random.sigma=2`),
and so can those of the files that it names (`--set airframe.mass.total=9.5`, `--set gains.tilt_limit=0.5`). A key that
is left out has its default, one that is not listed here is refused. Without a unit stand texts, counts and ratios;
lists have an entry for each axis x, y, z, or for each rotor in the order of the airframe. Frames:
[frames.md](frames.md).

An editor that knows the schema completes and checks keys as you type: [editors.md](editors.md).
"""

EFFECTS = """\
A table `[effects.NAME]` for each, with or without keys. What a scene does not name is not simulated and costs
nothing."""

SENSORS = """\
A table `[sensors.NAME]` for each that the vehicle carries. What is drawn once for a vehicle is given as one standard
deviation; mg and ug are thousandths and millionths of 9.80665 m/s^2."""

OF_MODEL = {"cooperative_load": ("cooperative_load", "formation")}
"""Tables that a model needs and that stand elsewhere than in its own file."""


def reference() -> str:
    """The page docs/reference.md: every key of the TOML files (Markdown)."""
    sections = {name: s for name, s in vocabulary().sections.items() if not s.FROM_FILE}
    by_model = _tables_by_model()
    general = [
        s for s in sections.values() if s not in by_model and s.TABLE not in ("effects", "sensors", "trajectory")
    ]
    chapters = {
        "Tables": [_section(section) for section in general],
        "Plant models": list(_models(by_model)),
        "Effects": [EFFECTS, *[_effect(name, *classes) for name, classes in effect_tables().items()]],
        "Sensors": [SENSORS, *[_sensor(name, *found) for name, found in sensor_tables().items()], _faults()],
        "Trajectory": list(_trajectory()),
        "Integrators": [_integrators()],
        "Airframes": list(_airframe()),
        "Gain sets": [_gains()],
        "Autopilot parameters": [_parameters()],
    }
    contents = "\n".join(f"- [{title}](#{title.lower().replace(' ', '-')})" for title in chapters)
    body = "\n\n".join(f"## {title}\n\n" + "\n\n".join(parts) for title, parts in chapters.items())
    return f"{HEAD}\n{contents}\n\n{body}\n"


def _doc(thing: Any) -> str:
    """A docstring, its paragraphs on one line each."""
    paragraphs = (inspect.getdoc(thing) or "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def _section(section: type[SceneTable]) -> str:
    needed = "" if section.OPTIONAL else " Always there, with these defaults."
    return f"### [{section.TABLE}]\n\n{_doc(section)}{needed if not _required(section) else ''}\n\n{_keys(section)}"


def _required(section: type[SceneTable]) -> bool:
    return any(field.is_required() for field in section.model_fields.values())


def _keys(section: type[SceneTable]) -> str:
    """The keys of a section, those of the tables within it, and what is checked of the whole scene."""
    parts = [key_table(keys(section))]
    parts += _inner_tables(section, section.TABLE)
    if "check" in vars(section):
        parts.append(f"Checked: {_doc(section.check)}")
    return "\n\n".join(parts)


def _inner_tables(cls: type, path: str) -> list[str]:
    """The keys of the tables within a table, and within those."""
    parts = []
    for key in keys(cls):
        for inner in _tables_in(key.hint):
            parts.append(f"`{path}.{key.name}`: {first_sentence(inner)}.\n\n{key_table(keys(inner))}")
            parts += _inner_tables(inner, f"{path}.{key.name}")
    return parts


def _tables_in(hint: Any) -> list[type]:
    """The classes of tables that an annotation mentions."""
    if isinstance(hint, type) and is_table(hint):
        return [hint]
    return [found for part in get_args(hint) for found in _tables_in(part)]


def _tables_by_model() -> dict[type[SceneTable], str]:
    """The tables that only one model of the plant has, with its name."""
    return {
        section: name
        for name in models.names()
        for section in vocabulary().sections.values()
        if section.__module__ == models.get(name).__name__ or section.TABLE in OF_MODEL.get(name, ())
    }


def _models(by_model: dict[type[SceneTable], str]) -> Iterator[str]:
    yield "`vehicle.model` names one of these."
    for name in models.names():
        parts = [f"### {name}", _doc(models.get(name))]
        for section, model in by_model.items():
            if model == name:
                parts += [f"**`[{section.TABLE}]`** {_doc(section)}", _keys(section)]
        yield "\n\n".join(parts)


def _effect(name: str, cls: type, settings: type) -> str:
    parts = [f"### {name}", f"**{_doc(effects.get(name))}** {_doc(cls)}"]
    kind = getattr(effects.get(name), "KIND", None)
    if kind:
        others = [f"`{n}`" for n in effects.names() if n != name and getattr(effects.get(n), "KIND", None) == kind]
        parts.append(f"A {kind}: a scene has at most one" + (f" (the others: {', '.join(others)})." if others else "."))
    built = getattr(cls, "from_scene", None)
    if built and "airframe" in (said := _doc(built)):
        parts.append(said)
    found = keys(settings)
    parts.append(key_table(found) if found else f"No keys: `[effects.{name}]`.")
    return "\n\n".join(parts)


def _sensor(name: str, module: ModuleType, cls: type) -> str:
    presets = module.PRESETS
    parts = [f"### {name}", _doc(module)]
    choices = ", ".join(f"`{p}`" for p in presets)
    parts.append(f"`preset`: {choices}; the first if left out. Other keys replace the preset's values.")
    parts.append(f"Channels of faults: {', '.join(f'`{channel}`' for channel in module.CHANNELS)}.")
    own = [key for key in keys(cls) if key.name != "faults"]
    inner = {key.name: key for key in own if hasattr(key.hint, "_fields")}
    parts.append(key_table([key for key in own if key.name not in inner], presets))
    for key in inner.values():
        values = {preset: getattr(p, key.name) for preset, p in presets.items()}
        parts.append(f"{_doc(key.hint)}\n\n{key_table(keys(key.hint), values, f'{key.name}.')}")
    return "\n\n".join(parts)


def _faults() -> str:
    text = f"`[[sensors.NAME.faults]]`, at most {SLOTS} of a sensor. {_doc(FaultTable)}"
    return f"### Faults\n\n{text}\n\n{key_table(keys(FaultTable))}"


def _trajectory() -> Iterator[str]:
    config = inspect.getmodule(vocabulary().sections["trajectory"])
    yield inspect.getdoc(config) or ""
    own = [
        key if key.name in ("name", "duration") else key._replace(hint=dict | list[dict], meaning="segments")
        for key in keys(Phase)
    ]
    yield f"### [[trajectory.phase]]\n\n{_doc(Phase)}\n\n{key_table(own)}"
    yield "u stands for m (x, y, z) or rad (yaw)."
    for name, segment in KINDS.items():
        own = [key for key in keys(segment) if key.name != "kind"]
        yield f'### kind = "{name}"\n\n{_doc(segment)}\n\n{key_table(own)}'


def _integrators() -> str:
    rows = []
    for name in integrators.names():
        module = integrators.get(name)
        evaluations = getattr(module, "EVALUATIONS", None)
        kept = "yes" if module.ON_MANIFOLD else "no"
        states = "rigid bodies" if hasattr(module, "unfit") else "any"
        cost = str(evaluations) if evaluations else "as needed"
        rows.append([f"`{name}`", number(module.ORDER), cost, kept, states, first_sentence(module)])
    text = "`solver.integrator`. On the manifold: attitudes stay rotations to round-off."
    return f"{text}\n\n" + table(["name", "order", "evaluations", "on the manifold", "states", "method"], rows)


def _airframe() -> Iterator[str]:
    yield "A TOML file that `vehicle.airframe` names. How its numbers are measured: [new_airframe.md](new_airframe.md)."
    tables = {key: _tables_in(key.hint) for key in keys(Airframe)}
    yield key_table([key for key, found in tables.items() if not found])
    for key, (cls, *_) in ((key, found) for key, found in tables.items() if found):
        optional = "" if Airframe.model_fields[key.name].is_required() else " May be left out."
        yield f"### [{key.name}]\n\n{_doc(cls)}{optional}\n\n{key_table(keys(cls))}"
        inner = {i for k in keys(cls) for i in _tables_in(k.hint)}
        for table_class in inner:
            yield f"Each of these tables: {_doc(table_class)}\n\n{key_table(keys(table_class))}"


def _gains() -> str:
    shipped = {name: gains.load(name) for name in gains.names()}
    text = f"A TOML file that `autopilot.gains` names. {_doc(GainSet)}"
    said = "; ".join(f"`{name}`: {g.description}" for name, g in shipped.items())
    own = [key for key in keys(GainSet) if key.name != "description"]
    description = [key for key in keys(GainSet) if key.name == "description"]
    return f"{text}\n\n{said}.\n\n{key_table(description)}\n\n{key_table(own, shipped)}"


def _parameters() -> str:
    fixed, by_gains = flight_parameters()
    rows = [
        [f"`{p.name}`", p.unit, f"{number(p.least)} ... {number(p.most)}", number(p.default), p.meaning] for p in fixed
    ]
    text = "`[autopilot.parameters]`, and MAVLink's parameters: they can be changed in flight."
    own = "Those that begin at the gain set's values; a gain has the bounds 0 and five times its value:"
    names = table(["name", "unit", "meaning"], [[f"`{p.name}`", p.unit, p.meaning] for p in by_gains])
    return f"{text}\n\n" + table(["name", "unit", "range", "default", "meaning"], rows) + f"\n\n{own}\n\n{names}"
