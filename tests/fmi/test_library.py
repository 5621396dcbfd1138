import ctypes
import math
import random
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from recorded_ports import RecordedPorts, scene_config

from lapwing.fmi.export.exported_part import ExportedPart, export_part
from lapwing.fmi.export.library import export_library
from lapwing.fmi.export.native_build import NATIVE, compiler
from lapwing.kernels.row_packing import row_width
from tests.combinations import NIGHTLY, rest_nightly
from tests.commands import assert_rejected, run_command

pytestmark = pytest.mark.long

SHORT = {"run.duration": 6.0, "success.require": "[]"}
VOID = ctypes.c_void_p


class NativePart:
    """An exported library, called through ctypes."""

    def __init__(self, folder: Path, name: str, part: ExportedPart):
        self.name, self.part = name, part
        self.library = ctypes.CDLL(str(folder / f"lib/lib{name}.so"))
        self.call("new").restype = VOID
        self.call("size").restype = ctypes.c_size_t
        self.call("tick").restype = self.call("missed").restype = ctypes.c_int64
        for function in ("advance", "tick", "missed", "free", "reset"):
            self.call(function).argtypes = [VOID]
        for function in ("write", "read"):
            self.call(function).argtypes = [VOID, ctypes.c_int, VOID]
        for function in ("save", "load"):
            self.call(function).argtypes = [VOID, VOID]
        self.call("get").argtypes = [VOID, ctypes.c_int, ctypes.POINTER(ctypes.c_double)]
        self.call("set").argtypes = [VOID, ctypes.c_int, ctypes.c_double]
        self.call("find").argtypes = [ctypes.c_char_p]
        self.instance = self.call("new")()

    def call(self, function: str):
        return getattr(self.library, f"{self.name}_{function}")

    def set_inputs(self, recorded: RecordedPorts, tick: int) -> None:
        for k, port in enumerate(self.part.inputs):
            row = recorded.sample(port.port.name, tick - port.lag)
            if row is not None:
                self.call("write")(self.instance, k, row.ctypes.data)

    def outputs(self) -> list[bytes]:
        rows = [np.zeros(row_width(port.port.example)) for port in self.part.outputs]
        for k, row in enumerate(rows):
            self.call("read")(self.instance, k, row.ctypes.data)
        return [row.tobytes() for row in rows]

    def compare(self, recorded: RecordedPorts, first: int, stop: int) -> None:
        """Step through the ticks [first, stop) and compare all outputs."""
        for tick in range(first, stop):
            self.set_inputs(recorded, tick)
            assert self.call("advance")(self.instance) in (0, 1)
            for port, row in zip(self.part.outputs, self.outputs(), strict=True):
                expected = recorded.sample(port.port.name, tick)
                assert expected is None or row == expected.tobytes(), f"{port.port.name} at tick {tick}"


def built(folder: Path, scene: str, part: str, **overrides) -> tuple[NativePart, RecordedPorts]:
    config = scene_config(scene, **overrides)
    exported = export_library(config, part, folder)
    return NativePart(folder, f"{scene}_{part}", exported), RecordedPorts(config)


@pytest.fixture(scope="module")
def hover(tmp_path_factory: pytest.TempPathFactory) -> tuple[NativePart, RecordedPorts]:
    return built(tmp_path_factory.mktemp("hover"), "hover", "plant", **SHORT)


def test_command_exports_library_with_recorded_bits(tmp_path: Path) -> None:
    arguments = ["hover", "--part", "plant", "--cpu", "x86-64-v2", "--out", str(tmp_path), "--set", "run.duration=2.0"]
    run_command("export-library", *arguments, code=0)
    config = scene_config("hover", **{"run.duration": 2.0})
    native, recorded = NativePart(tmp_path, "hover_plant", export_part(config, "plant")), RecordedPorts(config)
    native.compare(recorded, 0, recorded.ticks)
    assert recorded.ticks == 501


def test_library_needs_c_library_only(hover: tuple[NativePart, RecordedPorts]) -> None:
    path = hover[0].library._name
    needed = subprocess.run(["readelf", "-d", path], capture_output=True, text=True, check=True).stdout
    assert [line.split("[")[1][:-1] for line in needed.splitlines() if "NEEDED" in line] == ["libc.so.6"]
    symbols = subprocess.run(["nm", "-D", "--undefined-only", path], capture_output=True, text=True, check=True).stdout
    assert {line.split()[1].split("@")[0] for line in symbols.splitlines()} <= {
        "aligned_alloc", "free", "memcpy", "memset", "strcmp", "__stack_chk_fail",
    }  # fmt: skip
    assert Path(path).stat().st_size < 2e6


def test_saved_state_continues_in_other_instance(hover: tuple[NativePart, RecordedPorts]) -> None:
    native, recorded = hover
    native.call("reset")(native.instance)
    native.compare(recorded, 0, 700)
    state, again = (ctypes.create_string_buffer(native.call("size")()) for _ in range(2))
    native.call("save")(native.instance, state)
    first, native.instance = native.instance, native.call("new")()
    try:
        native.call("load")(native.instance, state)
        native.call("save")(native.instance, again)
        assert state.raw == again.raw
        native.compare(recorded, 700, recorded.ticks)
    finally:
        native.call("free")(native.instance)
        native.instance = first
    native.compare(recorded, 700, recorded.ticks)


def test_parameters_and_start_values_change_motion(hover: tuple[NativePart, RecordedPorts]) -> None:
    native, _ = hover
    self, value = native.instance, ctypes.c_double()
    native.call("reset")(self)
    height, mass, gravity = (
        native.call("find")(name.encode())
        for name in (
            "state.plant.vehicle.motion.position_world[2]",
            "parameters.plant.vehicle.body.mass",
            "parameters.plant.vehicle.effects.gravity.acceleration",
        )
    )
    assert min(height, mass, gravity) > 0
    assert native.call("find")(b"truth.unknown") == -1
    assert native.call("set")(self, height, 100.0) == 0
    assert native.call("set")(self, gravity, 2.0) == 0
    for _ in range(251):  # ticks 0 to 250: one second of free fall
        native.call("advance")(self)
    native.call("get")(self, native.call("find")(b"truth.position_world[2]"), ctypes.byref(value))
    assert value.value == pytest.approx(99.0, abs=1e-6)
    assert native.call("set")(self, height, 50.0) != 0  # a start value after the start
    assert native.call("get")(self, -1, ctypes.byref(value)) != 0


RANDOM_INPUTS = r"""
#include <math.h>
#include <stdio.h>
#include "hover_plant.h"
static unsigned long long seed = 88172645463325252ull;
static double uniform(void) {
    seed ^= seed << 13, seed ^= seed >> 7, seed ^= seed << 17;
    return (seed >> 11) * 0x1p-53;
}
int main(void) {
    const double special[] = {NAN, INFINITY, -INFINITY, 0.0, -0.0, 5e-324, 1e308, -1e308};
    const int widths[] = {WIDTHS};
    hover_plant *plant = hover_plant_new();
    long counts[3] = {0};
    for (long k = 0, numbers = 0; numbers < 1000000 || k % 25; k++) {
        if (k % 25 == 0) hover_plant_reset(plant);
        for (int port = 0; port < (int)(sizeof widths / sizeof *widths); port++) {
            double row[64];
            for (int i = 0; i < widths[port]; i++, numbers++)
                row[i] = uniform() < 0.02 ? special[(int)(8 * uniform())] : 100 * uniform() - 50;
            hover_plant_write(plant, port, row);
        }
        counts[hover_plant_advance(plant)]++;
    }
    printf("%ld %ld %ld\n", counts[0], counts[1], counts[2]);
    hover_plant_free(plant);
}
"""


def test_million_random_inputs_do_not_crash(hover: tuple[NativePart, RecordedPorts], tmp_path: Path) -> None:
    native, _ = hover
    folder, program = Path(native.library._name).parents[1], tmp_path / "random"
    widths = ", ".join(str(row_width(port.port.example)) for port in native.part.inputs)
    source = tmp_path / "random.c"
    source.write_text(RANDOM_INPUTS.replace("WIDTHS", widths))
    flags = ["-O1", f"-I{folder}/include", "-fsanitize=undefined", "-fno-sanitize-recover"]
    archive = str(folder / "lib/libhover_plant.a")
    subprocess.run([*compiler(), *flags, str(source), archive, "-lm", "-o", str(program)], check=True)
    done = subprocess.run([str(program)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    running, _, failed = map(int, done.stdout.split())
    assert running > 10_000
    assert failed > 1_000  # states that became non-finite


@pytest.mark.skipif(not shutil.which("cmake") or not shutil.which("cc"), reason="needs CMake and a C compiler")
def test_example_builds_by_cmake_and_steps(hover: tuple[NativePart, RecordedPorts], tmp_path: Path) -> None:
    folder = Path(hover[0].library._name).parents[1]
    for command in (["cmake", str(folder / "example")], ["cmake", "--build", "."]):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    done = subprocess.run([str(tmp_path / "example"), "1000", "0.2"], capture_output=True, text=True, check=True)
    assert "200 steps at 1000 Hz: t = 0.8 s" in done.stdout


def test_static_libraries_of_two_parts_link_into_one_program(tmp_path: Path) -> None:
    config = scene_config("hover", **SHORT)
    for part in ("plant", "autopilot"):
        export_library(config, part, tmp_path)
    source = tmp_path / "main.c"
    source.write_text(
        '#include "hover_plant.h"\n#include "hover_autopilot.h"\n'
        "int main(void) { hover_plant *a = hover_plant_new(); hover_autopilot *b = hover_autopilot_new();\n"
        "return hover_plant_advance(a) || hover_autopilot_advance(b); }\n"
    )
    archives = [str(tmp_path / f"lib/libhover_{part}.a") for part in ("plant", "autopilot")]
    program = tmp_path / "main"
    subprocess.run([*compiler(), f"-I{tmp_path}/include", str(source), *archives, "-o", str(program)], check=True)
    assert subprocess.run([str(program)], check=False).returncode == 0


def test_native_frexp_equals_that_of_python(tmp_path: Path) -> None:
    (tmp_path / "tables.h").write_text(
        "#define IMAGE_SIZE 1\n#define RELOCATIONS 0\n#define BLOCKS 0\n#define VEHICLES 0\n#define INPUTS 0\n"
        "#define STAGED 0\n#define ACTIONS 0\n#define VARIABLES 0\n#define PART_IMAGE part_start\n"
        "#define PART_INTERVAL 1.0\nstatic const relocation part_relocations[1]; static const block part_blocks[1];\n"
        "static const port part_inputs[1], part_outputs[1]; static const double part_start[1];\n"
        "static const action part_actions[1]; static const write_of part_writes[1];\n"
        "static const unsigned char part_written[1]; static const variable part_variables[1];\n"
    )
    out = tmp_path / "frexp.so"
    command = [*compiler(), "-shared", "-fPIC", "-w", f"-I{tmp_path}", str(NATIVE / "runtime.c"), "-o", str(out)]
    subprocess.run(command, check=True)
    frexp = ctypes.CDLL(str(out)).numba_frexp
    frexp.restype, frexp.argtypes = ctypes.c_double, [ctypes.c_double, ctypes.POINTER(ctypes.c_int)]
    exponent, rng = ctypes.c_int(), random.Random(2)
    for x in [0.0, -0.0, 5e-324, -2.2e-310, 1.0, 0.5, math.inf, 1.7e308, *(rng.gauss(0, 1e3) for _ in range(1000))]:
        assert (frexp(x, ctypes.byref(exponent)), exponent.value) == math.frexp(x)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["hover", "--part", "wing"],
            "--part wing: unknown; use one of plant, sensors, autopilot, trajectory, vehicle",
        ),
        (["hover", "--cpu", "z80"], "--cpu z80: unknown; use one of x86-64-v2"),
        (["hover", "--part", "sensors"], "--part sensors: scene hover has no sensors; use one of plant, autopilot"),
    ],
)
def test_invalid_export_is_rejected_in_one_line(arguments: list[str], message: str, tmp_path: Path) -> None:
    out = tmp_path / "lib"
    assert_rejected(run_command("export-library", *arguments, "--out", out), message)  # fmt: skip
    assert not out.exists() or not any(out.iterdir())


@pytest.mark.parametrize("part", rest_nightly("vehicle", "plant"))
@pytest.mark.parametrize(
    "scene", rest_nightly("delivery_mission", "carried_load", "fleet", "os4_hover", "unload", "gyrostat_chaotic")
)
def test_scene_has_bits_of_its_run(scene: str, part: str, tmp_path: Path) -> None:
    native, recorded = built(tmp_path, scene, part)
    native.compare(recorded, 0, recorded.ticks)
    assert native.call("missed")(native.instance) == 0


@NIGHTLY
@pytest.mark.parametrize("part", ["sensors", "autopilot"])
def test_part_of_mission_has_bits_of_its_run(part: str, tmp_path: Path) -> None:
    native, recorded = built(tmp_path, "delivery_mission", part)
    native.compare(recorded, 0, recorded.ticks)
