"""Description of a vehicle from a scene and a log, and import rules of the service."""

import ast
from pathlib import Path

import pytest

from lapwing.services.mavlink.resolve import describe, resolve
from lapwing.services.scene_resolver import load

FOLDER = Path("services/mavlink")


def test_vehicle_of_scene_is_described():
    d = describe(
        load("lapwing/scenes/groundstation.toml", ["vehicle.name=bee", "mavlink.system_id=7", "communication.rate=500"])
    )
    assert (d.name, d.system_id, d.firmware, len(d.rotors), d.tick_ns) == ("bee", 7, "px4", 4, 2_000_000)
    assert d.sensors == ("barometer", "gps", "imu", "magnetometer", "sonar")
    assert (d.battery.cells, d.battery.empty_voltage) == (12, 3.0)
    assert 4.0 < d.battery.charged_voltage < 4.2
    assert d.max_voltage > 0.0
    assert d.accepts_commands
    assert "MIS_TAKEOFF_ALT" in {p.name for p in d.parameters}


def test_missing_parts_are_not_described():
    d = describe(load("lapwing/scenes/hover.toml"))
    assert (d.sensors, d.battery, d.accepts_commands) == ((), None, False)


def test_scene_without_autopilot_has_no_description():
    assert resolve(load("lapwing/scenes/gyrostat_blocked.toml")) is None


def test_unknown_firmware_error_lists_choices():
    from lapwing.services.mavlink import firmware

    with pytest.raises(ValueError, match=r"unknown firmware 'px'; did you mean px4\? \(firmwares: ardupilot, px4\)"):
        firmware.get("px")


SCENE = (
    "lapwing.cosim.scene",
    *(f"lapwing.services.common.{name}" for name in ("sections", "exchange", "vehicle", "modules")),
)


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{name.name}" for name in node.names)
        elif isinstance(node, ast.Import):
            yield from (name.name for name in node.names)


def test_only_description_imports_scene():
    for path in FOLDER.rglob("*.py"):
        if path.name not in ("resolve.py", "schema.py"):
            result = {n for n in imports(path) if n.startswith(SCENE)}
            assert not result, path


def test_handlers_and_telemetry_import_no_adapter():
    for path in (*FOLDER.glob("protocols/*.py"), *FOLDER.glob("telemetry/*.py")):
        assert not {n for n in imports(path) if ".adapter" in n or ".link_server" in n or ".endpoint" in n}, path


def test_no_import_for_type_hints_only():
    for path in FOLDER.rglob("*.py"):
        assert "TYPE_CHECKING" not in path.read_text(), path


def test_no_import_cycles():
    modules = {
        str(path.with_suffix("")).replace("/", ".").removesuffix(".__init__"): path for path in FOLDER.rglob("*.py")
    }

    def named(full):
        return full if full in modules else full.rpartition(".")[0]

    edges = {name: {named(i) for i in imports(path)} & set(modules) - {name} for name, path in modules.items()}

    def visit(name, way):
        assert name not in way, " -> ".join([*way, name])
        for other in edges[name]:
            visit(other, [*way, name])

    for name in modules:
        visit(name, [])


def test_private_members_stay_private():
    for path in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
                owner = getattr(node.value, "id", "")
                assert owner in ("self", "cls"), f"{path}: {owner}.{node.attr}"
