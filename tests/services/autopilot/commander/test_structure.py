"""Structure of the commander: acyclic imports, and one module per mode of the table."""

import ast
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

from lapwing.services.autopilot import commander
from lapwing.services.autopilot.commander.mode_table import MODES

FOLDER, PACKAGE = Path(commander.__file__).parent, commander.__name__


def modules():
    """Return the files by module name."""
    names = {path: [PACKAGE, *path.relative_to(FOLDER).with_suffix("").parts] for path in FOLDER.rglob("*.py")}
    return {".".join(parts).removesuffix(".__init__"): path for path, parts in names.items()}


def imported_modules(path, known):
    """Return the modules of the package that a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            yield from {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)} & known
        elif isinstance(node, ast.Import):
            yield from {alias.name for alias in node.names} & known


def test_imports_are_acyclic_and_below_commander():
    result = modules()
    diagram = {name: set(imported_modules(path, set(result))) - {name} for name, path in result.items()}
    order = list(TopologicalSorter(diagram).static_order())  # raises CycleError, with the cycle
    assert len(order) == len(result) > 20
    assert [name for name in diagram if f"{PACKAGE}.commander" in diagram[name]] == []
    for name in diagram:
        if name.startswith(f"{PACKAGE}.modes"):
            assert f"{PACKAGE}.state" not in diagram[name]


def test_every_module_of_mode_is_in_table():
    result = [import_module(name) for name in modules() if name.startswith(f"{PACKAGE}.modes.")]
    assert {m.NAME: m.Mode for m in result if hasattr(m, "NAME")} == MODES
