"""Native libraries: the binary of a part as shared and static library, with the files that a C or C++ project needs."""

import re
from pathlib import Path

from lapwing.cosim.config.provenance import package_version
from lapwing.cosim.config.run_config import RunConfig
from lapwing.fmi.c_header import class_name, header, identifier, wrapper
from lapwing.fmi.exported_part import ExportedPart, export_part
from lapwing.fmi.machine_code import PORTABLE
from lapwing.fmi.native_build import NATIVE, archive, build_folder
from lapwing.fmi.variables import variables_of

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
project({name}_example CXX)
set(CMAKE_CXX_STANDARD 17)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
find_package({name} CONFIG REQUIRED PATHS "${{CMAKE_CURRENT_LIST_DIR}}/../lib/cmake/{name}" NO_DEFAULT_PATH)
add_executable(example main.cpp)
target_link_libraries(example {name}::{name})
"""
_EXAMPLE = """// Steps the part at a fixed rate of wall time and prints the jitter: example [rate in Hz] [seconds]
#include <{name}.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

int main(int argc, char **argv) {{
    using clock = std::chrono::steady_clock;
    const double rate = argc > 1 ? std::atof(argv[1]) : 1000.0;
    const double duration = argc > 2 ? std::atof(argv[2]) : 1.0;
    const int steps = static_cast<int>(rate * duration);
    if (!(rate > 0.0) || steps < 1) {{
        std::fprintf(stderr, "usage: example [rate in Hz] [seconds]\\n");
        return 2;
    }}
    {cls} part;
    part.advance();  // tick 0
    std::vector<double> late(steps), cost(steps);  // [us]
    const auto start = clock::now();
    for (int k = 0; k < steps; k++) {{
        const auto due = start + std::chrono::duration_cast<clock::duration>(std::chrono::duration<double>(k / rate));
        std::this_thread::sleep_until(due);
        const auto begin = clock::now();
        part.advance();
        const auto end = clock::now();
        late[k] = std::chrono::duration<double, std::micro>(begin - due).count();
        cost[k] = std::chrono::duration<double, std::micro>(end - begin).count();
    }}
    std::sort(late.begin(), late.end());
    std::sort(cost.begin(), cost.end());
    std::printf("%d steps at %g Hz: t = %g s\\n", steps, rate, part.time());
    std::printf("wake-up late by: median %.1f us, 99 %% %.1f us, max %.1f us\\n", late[steps / 2],
                late[steps * 99 / 100], late.back());
    std::printf("step takes: median %.2f us, 99 %% %.2f us, max %.2f us\\n", cost[steps / 2],
                cost[steps * 99 / 100], cost.back());
{report}    return 0;
}}
"""


def library_name(setup: RunConfig, part_name: str) -> str:
    """Return the name of the library of a part, a C identifier."""
    return re.sub(r"^(?=\d)|\W", "_", f"{setup.scene}_{part_name}")


def export_library(setup: RunConfig, part_name: str, out: Path, cpu: str = PORTABLE) -> ExportedPart:
    """Write a shared and a static library with header, C++ wrapper, CMake package, pkg-config file and example.

    Args:
        setup: run configuration of the scene.
        part_name: one of `exported_part.PARTS`.
        out: folder, created if missing.
        cpu: generation of processors that run it.

    Raises:
        ValueError: the part cannot be exported, or there is no C compiler.
    """
    part = export_part(setup, part_name)
    variables = variables_of(part)
    name = library_name(setup, part_name)
    with build_folder(part, variables, name, cpu) as build:
        objects = [build.compile(NATIVE / "runtime.c"), build.compile(NATIVE / "library.c")]
        for folder in ("include", f"lib/cmake/{name}", "lib/pkgconfig", "example"):
            (out / folder).mkdir(parents=True, exist_ok=True)
        build.link(objects, out / f"lib/lib{name}.so", f"{name}_*")
        archive([*objects, *build.objects], out / f"lib/lib{name}.a")
    fields = {"name": name, "part": part.name, "scene": setup.scene, "version": package_version()}
    texts = {
        f"include/{name}.h": header(part, name),
        f"include/{name}.hpp": wrapper(part, name),
        f"lib/cmake/{name}/{name}-config.cmake": _CMAKE.format(**fields),
        f"lib/pkgconfig/{name}.pc": _PKG_CONFIG.format(**fields),
        "example/CMakeLists.txt": _EXAMPLE_CMAKE.format(**fields),
        "example/main.cpp": _EXAMPLE.format(cls=class_name(name), report=_report(part), **fields),
    }
    for path, text in texts.items():
        (out / path).write_text(text, encoding="utf-8")
    return part


def _report(part: ExportedPart) -> str:
    """Return a line of the example that prints the true position."""
    for port in part.outputs:
        if hasattr(port.port.like, "position_world"):
            return (
                f"    const auto x = part.{identifier(port)}();\n"
                '    std::printf("position: %.3f %.3f %.3f m\\n", x.position_world[0], x.position_world[1],'
                " x.position_world[2]);\n"
            )
    return ""
