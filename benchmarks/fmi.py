"""Cost of exported FMUs in free fall, and of imported ones in a run.

python -m benchmarks.fmi [--scene SCENE] [--rate HZ]
"""

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._command import command_line
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.diagram.compiled_loop import run
from lapwing.fmi.export.fmu import export_fmu
from lapwing.fmi.export.memory_image import image_of
from lapwing.fmi.export.native_build import compiler
from lapwing.services import scene_resolver
from lapwing.services.process_table import create_all

STEPS, REPEATS = 500, 200  # short, so that some repeats are not interrupted
SETTLE, IMPORT_STEPS, IMPORT_REPEATS = 10, 3000, 9
LOOP = """
#include <stdbool.h>
#include <time.h>
typedef int do_step(void *, double, double, bool, bool *, bool *, bool *, double *);
double loop(do_step *step, void *instance, long first, double h, long n) {
    struct timespec a, b;
    bool event, terminate, early;
    double reached;
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (long k = first; k < first + n; k++) step(instance, k * h, h, true, &event, &terminate, &early, &reached);
    clock_gettime(CLOCK_MONOTONIC, &b);
    return (b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec);
}
"""
HEIGHT, HEIGHT_VARIABLE = 1000.0, "state.plant.vehicle.motion.position_world[2]"  # [m]


def best(function: Callable[[], float]) -> float:
    return min(function() for _ in range(REPEATS))


def in_the_air(diagram: BlockDiagram) -> None:
    """Move the vehicle to its start height."""
    blocks = zip(diagram._blocks, diagram._codes, strict=True)
    image = image_of([(part.name, bound.cell) for part, bound in blocks if bound], diagram._rows)
    (leaf,) = (leaf for leaf in image.leaves if leaf.path == "plant|state.vehicle.motion.position_world[2]")
    (region,) = (r for r in image.regions if r.offset <= leaf.offset < r.offset + r.size)
    ctypes.c_double.from_address(region.address + leaf.offset - region.offset).value = HEIGHT


def step_in_run(config: RunConfig) -> float:
    """Return the time of a plant step in the compiled loop of a run [us]: full inputs, zero motor voltage."""

    def once() -> float:
        services = [s for s in create_all(config) if s.name == "plant"]
        diagram = BlockDiagram(config, services, 1)  # owns the memory of the group
        in_the_air(diagram)
        (group,) = diagram._groups
        run(group._cell, 0, 0, 10)
        began = time.perf_counter()
        run(group._cell, 10, 0, 10 + STEPS)
        return (time.perf_counter() - began) / STEPS * 1e6

    return best(once)


def timed_steps(folder: Path) -> Any:
    """Return a compiled function (doStep, instance, first step, interval, steps) -> seconds."""
    source, library = folder / "loop.c", folder / "loop.so"
    source.write_text(LOOP)
    subprocess.run([*compiler(), "-O2", "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
    function = ctypes.CDLL(str(library)).loop
    function.restype = ctypes.c_double
    function.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_long, ctypes.c_double, ctypes.c_long]
    return function


def main(scene: str = "delivery_mission", rate: int = 1000) -> None:
    import fmpy

    settings = [f"communication.rate={rate}", f"solver.step={1.0 / rate!r}"]
    config = scene_resolver.resolve(scene_resolver.load(scene, settings))
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "plant.fmu"
        export_fmu(config, "plant", path)
        folder = fmpy.extract(str(path))
        model = fmpy.read_model_description(str(path))
        binary = next(Path(folder).glob("binaries/*/*.so"))
        library = ctypes.CDLL(str(binary))
        make, end = library.fmi3InstantiateCoSimulation, library.fmi3FreeInstance
        make.restype = ctypes.c_void_p
        end.argtypes = [ctypes.c_void_p]
        enter = library.fmi3EnterInitializationMode
        flag, number = ctypes.c_bool, ctypes.c_double
        enter.argtypes = [ctypes.c_void_p, flag, number, number, flag, number]
        library.fmi3ExitInitializationMode.argtypes = [ctypes.c_void_p]
        place = {v.name: v.valueReference for v in model.modelVariables}[HEIGHT_VARIABLE]
        one = ctypes.c_size_t(1)
        reference, height = ((ctypes.c_uint32 * 1)(place), one), ((ctypes.c_double * 1)(HEIGHT), one)

        def instantiate() -> int:
            token = model.guid.encode()
            return make(b"a", token, None, False, False, False, False, None, ctypes.c_size_t(0), None, None, None)

        loop, address = timed_steps(Path(name)), ctypes.cast(library.fmi3DoStep, ctypes.c_void_p)

        def once() -> float:
            instance = instantiate()
            library.fmi3SetFloat64(ctypes.c_void_p(instance), *reference, *height)
            enter(instance, False, 0.0, 0.0, False, 0.0)
            library.fmi3ExitInitializationMode(instance)
            loop(address, instance, 0, config.interval, 10)
            result = loop(address, instance, 10, config.interval, STEPS) / STEPS * 1e6
            end(instance)
            return result

        inside, outside = step_in_run(config), best(once)
        began = time.perf_counter()
        end(instantiate())
        print(f"{scene}: tick {config.interval * 1e3:g} ms, free fall")
        print(f"  step in the run {inside:.2f} us, doStep {outside:.2f} us, ratio {outside / inside:.2f}")
        print(
            f"  instantiate {1e3 * (time.perf_counter() - began):.3f} ms, binary {binary.stat().st_size / 1e6:.3f} MB"
        )

        import_overhead(scene, settings, path, outside)


def import_overhead(scene: str, settings: list[str], path: Path, own: float) -> None:
    """Print the time that an imported FMU of the plant adds to a tick of the scene.

    The scene flies alternately without and with the FMU, which then moves the vehicle while Lapwing's plant is stepped,
    too. The flights are bit-for-bit identical, so the difference is the import and the doStep (`own`).
    """
    from fmpy import read_model_description

    names = [v.name for v in read_model_description(str(path)).modelVariables if v.causality in ("input", "output")]
    columns = {name: name.replace("[", ".").replace("]", "") for name in names}
    inputs = [name for name in names if name.startswith("actuators.motor_voltage")]
    outputs = [name for name in names if name.startswith(("truth.position_world", "truth.velocity_world"))]
    entries = [
        f'fmu = "{path}"',
        "delay = 1",
        f'start = {{"{HEIGHT_VARIABLE}" = {HEIGHT}}}',
        "inputs = {" + ", ".join(f'"{name}" = "{columns[name]}"' for name in inputs) + "}",
        "outputs = {" + ", ".join(f'"{columns[name]}" = "{name}"' for name in outputs) + "}",
    ]
    table = f"services.copy={{{', '.join(entries)}}}"
    configs = [scene_resolver.resolve(scene_resolver.load(scene, [*settings, *more])) for more in ([], [table])]
    times, flights = np.empty((IMPORT_REPEATS, 2, IMPORT_STEPS)), [b"", b""]
    for k in range(IMPORT_REPEATS):
        for which, config in enumerate(configs):
            diagram = BlockDiagram(config, create_all(config), 1)
            in_the_air(diagram)
            diagram.advance(SETTLE)  # starts the process of the FMU
            for step in range(IMPORT_STEPS):
                began = time.perf_counter()
                diagram.advance(SETTLE + step + 1)
                times[k, which, step] = time.perf_counter() - began
            flights[which] = diagram.row("truth.copy" if which else "truth", SETTLE + IMPORT_STEPS - 1).tobytes()
    assert flights[0] == flights[1]
    added = np.diff(1e6 * np.median(times, axis=2), axis=1) - own  # in pairs; medians, as other work interrupts steps
    print(f"  import with {len(inputs)} inputs and {len(outputs)} outputs: {np.median(added):.1f} us a step beyond")
    print(f"    the FMU's own time (median of {IMPORT_REPEATS} pairs; {added.min():.1f} to {added.max():.1f} us)")
    free = np.diff(1e6 * np.quantile(times, 0.1, axis=2), axis=1) - own  # short steps, rarely interrupted by other work
    print(f"    {np.median(free):.1f} us from the lowest deciles ({free.min():.1f} to {free.max():.1f} us)")


if __name__ == "__main__":
    command_line(main)
