"""Parts of a scene for other programs: native libraries and FMUs."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import claim, create_folder
from lapwing.cli.preflight import with_solver_selected

Part = Annotated[str, typer.Option(metavar="PART", help="plant, sensors, autopilot, trajectory or vehicle (all)")]
Cpu = Annotated[str, typer.Option(metavar="NAME", help="processors that run it: x86-64-v2, -v3, -v4 or native")]
AllowCode = Annotated[bool, typer.Option("--allow-code", help="run FMUs of the scene to record its flight manager")]


def _check(part: str, cpu: str) -> None:
    from lapwing.fmi.export.exported_part import PARTS
    from lapwing.fmi.export.machine_code import architectures

    for option, value, choices in (("--part", part, PARTS), ("--cpu", cpu, architectures())):
        if value not in choices:
            raise ValueError(f"{option} {value}: unknown; use one of {', '.join(choices)}")


@app.command("export-library")
def export_library(
    scene: SceneFile,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="where to write the libraries, headers and example")],
    part: Part = "plant",
    cpu: Cpu = "x86-64-v3",
    allow_code: AllowCode = False,
    set_: Overrides = None,
) -> None:
    """Export a part of a scene as a native library for C.

    The library has the machine code of `lapwing run` and computes the same bits. It needs neither Python nor numba.
    """
    from lapwing.services.common import foreign_code

    with foreign_code.permission(allow_code):
        _check(part, cpu)
        from lapwing.fmi.export.library import export_library, library_name
        from lapwing.services.scene_resolver import resolve

        config = resolve(with_solver_selected(scene, set_ or []))
        create_folder(out, parents=True)
        export_library(config, part, out, cpu)
        name = library_name(config, part)
        size = (out / f"lib/lib{name}.so").stat().st_size / 1e6
        typer.echo(f"{out}: library {name} ({size:.2f} MB), header include/{name}.h, CMake package, example")


@app.command("export-fmu")
def export_fmu(
    scene: SceneFile,
    out: Annotated[Path, typer.Option(metavar="FILE", help="FMU to write, NAME.fmu")],
    part: Part = "plant",
    fmi: Annotated[int, typer.Option(metavar="N", help="version of FMI: 2 or 3")] = 3,
    cpu: Cpu = "x86-64-v3",
    allow_code: AllowCode = False,
    set_: Overrides = None,
) -> None:
    """Export a part of a scene as an FMU for co-simulation.

    The FMU has the machine code of `lapwing run` and computes the same bits. It needs neither Python nor numba.
    """
    from lapwing.services.common import foreign_code

    with foreign_code.permission(allow_code):
        _check(part, cpu)
        _check_fmi(fmi)
        if out.suffix != ".fmu":
            raise ValueError(f"--out {out}: is not the name of an FMU; use a name that ends in .fmu")
        from lapwing.fmi.export.fmu import export_fmu
        from lapwing.services.scene_resolver import resolve

        claim(out)
        config = resolve(with_solver_selected(scene, set_ or []))
        result = export_fmu(config, part, out, fmi, cpu)
        ports = f"inputs {_names(result.inputs)}; outputs {_names(result.outputs)}"
        typer.echo(f"{out}: FMI {fmi}.0, {out.stat().st_size / 1e6:.2f} MB, step {config.interval:g} s; {ports}")


@app.command("export-ssp")
def export_ssp(
    scene: SceneFile,
    out: Annotated[Path, typer.Option(metavar="FILE", help="package to write, NAME.ssp")],
    fmi: Annotated[int, typer.Option(metavar="N", help="version of FMI: 3 (SSP 2.0) or 2 (SSP 1.0)")] = 3,
    cpu: Cpu = "x86-64-v3",
    allow_code: AllowCode = False,
    set_: Overrides = None,
) -> None:
    """Export a scene as a package of connected FMUs (SSP).

    `lapwing run NAME.ssp` flies it, also after FMUs were exchanged. SSP tools simulate it without Lapwing.
    """
    from lapwing.services.common import foreign_code

    with foreign_code.permission(allow_code):
        _check("vehicle", cpu)
        _check_fmi(fmi)
        if out.suffix != ".ssp":
            raise ValueError(f"--out {out}: is not the name of a package; use a name that ends in .ssp")
        from lapwing.fmi.export.system_package import SSP_VERSIONS, export_system
        from lapwing.services.scene_resolver import resolve

        claim(out)
        parts = export_system(resolve(with_solver_selected(scene, set_ or [])), out, fmi, cpu)
        size = out.stat().st_size / 1e6
        typer.echo(f"{out}: SSP {SSP_VERSIONS[fmi]}, {size:.2f} MB, FMUs (FMI {fmi}.0) {', '.join(parts)}")


def _check_fmi(version: int) -> None:
    if version not in (2, 3):
        raise ValueError(f"--fmi {version}: unknown version; use 2 or 3")


def _names(ports: list) -> str:
    return ", ".join(each.port.name for each in ports) or "none"
