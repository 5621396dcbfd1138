"""Native libraries: the binary of a part as shared and static library, with the files that a C project needs."""

import re
from pathlib import Path

from lapwing.cosim.config.provenance import package_version
from lapwing.cosim.config.run_config import RunConfig
from lapwing.fmi.export.c_header import header, identifier
from lapwing.fmi.export.exported_part import ExportedPart, export_part
from lapwing.fmi.export.machine_code import PORTABLE
from lapwing.fmi.export.native_build import NATIVE, archive, build_folder
from lapwing.fmi.export.variables import variables_of

_CMAKE = """# CMake package: find_package({name} CONFIG PATHS <this folder>) and link {name}::{name} or {name}::static
get_filename_component(_{name}_root "${{CMAKE_CURRENT_LIST_DIR}}/../../.." ABSOLUTE)
foreach(_{name}_kind shared static)
  string(TOUPPER ${{_{name}_kind}} _{name}_type)
  set(_{name}_target {name}::${{_{name}_kind}})
  if(_{name}_kind STREQUAL shared)
    set(_{name}_target {name}::{name})
    set(_{name}_file lib{name}.so)
  else()
    set(_{name}_file lib{name}.a)
  endif()
  if(NOT TARGET ${{_{name}_target}})
    add_library(${{_{name}_target}} ${{_{name}_type}} IMPORTED)
    set_target_properties(${{_{name}_target}} PROPERTIES
      IMPORTED_LOCATION "${{_{name}_root}}/lib/${{_{name}_file}}"
      INTERFACE_INCLUDE_DIRECTORIES "${{_{name}_root}}/include")
  endif()
endforeach()
"""
_PKG_CONFIG = """prefix=${{pcfiledir}}/../..
Name: {name}
Description: {part} of the Lapwing scene {scene}
Version: {version}
Cflags: -I${{prefix}}/include
Libs: -L${{prefix}}/lib -l{name}
"""
_EXAMPLE_CMAKE = """cmake_minimum_required(VERSION 3.16)
project({name}_example C)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
find_package({name} CONFIG REQUIRED PATHS "${{CMAKE_CURRENT_LIST_DIR}}/../lib/cmake/{name}" NO_DEFAULT_PATH)
add_executable(example main.c)
target_link_libraries(example {name}::{name})
"""
_EXAMPLE = """/* Steps the part at a fixed rate of wall time and prints the jitter: example [rate in Hz] [seconds] */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <{name}.h>

static double seconds(void) {{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}}

static int by_size(const void *a, const void *b) {{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}}

static void report(const char *title, double *times, int n) {{
    qsort(times, (size_t)n, sizeof *times, by_size);
    printf("%s: median %.2f us, 99 %% %.2f us, max %.2f us\\n", title, 1e6 * times[n / 2], 1e6 * times[(int)(0.99 * n)],
           1e6 * times[n - 1]);
}}

int main(int argc, char **argv) {{
    const double rate = argc > 1 ? atof(argv[1]) : 1000.0, duration = argc > 2 ? atof(argv[2]) : 1.0;
    const int steps = (int)(rate * duration);
    if (!(rate > 0.0) || steps < 1) {{
        fprintf(stderr, "usage: example [rate in Hz] [seconds]\\n");
        return 2;
    }}
    {name} *part = {name}_new();
    double *late = calloc((size_t)steps, sizeof *late), *cost = calloc((size_t)steps, sizeof *cost);
    if (!part || !late || !cost) return 1;
    {name}_advance(part); /* tick 0 */
    const double start = seconds();
    for (int k = 0; k < steps; k++) {{
        const double due = start + k / rate, rest = due - seconds();
        if (rest > 0.0) nanosleep(&(struct timespec){{(time_t)rest, (long)(1e9 * (rest - (time_t)rest))}}, NULL);
        const double begin = seconds();
        {name}_advance(part);
        late[k] = begin - due, cost[k] = seconds() - begin;
    }}
    printf("%d steps at %g Hz: t = %g s\\n", steps, rate, (double){name}_tick(part) * {upper}_INTERVAL);
    report("wake-up late by", late, steps);
    report("step takes", cost, steps);
{position}    {name}_free(part);
    return 0;
}}
"""


def library_name(config: RunConfig, part_name: str) -> str:
    """Return the name of the library of a part, a C identifier."""
    return re.sub(r"^(?=\d)|\W", "_", f"{config.scene}_{part_name}")


def export_library(config: RunConfig, part_name: str, out: Path, cpu: str = PORTABLE) -> ExportedPart:
    """Write a shared and a static library with header, CMake package, pkg-config file and example.

    Args:
        config: run configuration of the scene.
        part_name: one of `exported_part.PARTS`.
        out: folder, created if missing.
        cpu: generation of processors that run it.

    Raises:
        ValueError: the part cannot be exported, or there is no C compiler.
    """
    part = export_part(config, part_name)
    variables = variables_of(part)
    name = library_name(config, part_name)
    with build_folder(part, variables, name, cpu) as build:
        objects = [build.compile(NATIVE / "runtime.c"), build.compile(NATIVE / "library.c")]
        for folder in ("include", f"lib/cmake/{name}", "lib/pkgconfig", "example"):
            (out / folder).mkdir(parents=True, exist_ok=True)
        build.link(objects, out / f"lib/lib{name}.so", f"{name}_*")
        archive([*objects, *build.objects], out / f"lib/lib{name}.a")
    fields = {"name": name, "part": part.name, "scene": config.scene, "version": package_version()}
    texts = {
        f"include/{name}.h": header(part, name),
        f"lib/cmake/{name}/{name}-config.cmake": _CMAKE.format(**fields),
        f"lib/pkgconfig/{name}.pc": _PKG_CONFIG.format(**fields),
        "example/CMakeLists.txt": _EXAMPLE_CMAKE.format(**fields),
        "example/main.c": _EXAMPLE.format(upper=name.upper(), position=_position(part, name), **fields),
    }
    for path, text in texts.items():
        (out / path).write_text(text, encoding="utf-8")
    return part


def _position(part: ExportedPart, name: str) -> str:
    """Return lines of the example that print the true position; "" if it is no output."""
    for port in part.outputs:
        if hasattr(port.port.example, "position_world"):
            own = identifier(port)
            return (
                f"    {name}_{own} sample;\n    {name}_get_{own}(part, &sample);\n"
                "    const double *x = sample.position_world;\n"
                '    printf("position: %.3f %.3f %.3f m\\n", x[0], x[1], x[2]);\n'
            )
    return ""
