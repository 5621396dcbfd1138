"""Functional mock-up units: archive with the binary of a part, its description and documentation."""

import hashlib
import html
import re
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.config.provenance import package_version
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import to_json
from lapwing.cosim.output_lock import write_errors
from lapwing.fmi.export import variables as kinds
from lapwing.fmi.export.exported_part import ExportedPart, export_part
from lapwing.fmi.export.machine_code import PORTABLE
from lapwing.fmi.export.model_description import ModelNames, description
from lapwing.fmi.export.native_build import NATIVE, build_folder
from lapwing.fmi.export.variables import Variable, variables_of

BINARIES = {3: "binaries/x86_64-linux", 2: "binaries/linux64"}
ZIP_DATE = (1980, 1, 1, 0, 0, 0)  # date of every file in the archive, so that equal inputs give equal bytes


def export_fmu(config: RunConfig, part_name: str, out: Path, version: int = 3, cpu: str = PORTABLE) -> ExportedPart:
    """Write an FMU for co-simulation.

    Args:
        config: run configuration of the scene.
        part_name: one of `exported_part.PARTS`.
        out: path of the FMU.
        version: version of FMI, 2 or 3.
        cpu: generation of processors that run it.

    Raises:
        ValueError: the part cannot be exported, or there is no C compiler.
    """
    part = export_part(config, part_name)
    variables = variables_of(part)
    identifier = re.sub(r"^(?=\d)|\W", "_", out.stem)
    names = ModelNames(identifier, _token(part, variables), f"Lapwing {package_version()}")
    with build_folder(part, variables, "lapwing", cpu) as build:
        (build.path / "token.h").write_text(f'#define INSTANTIATION_TOKEN "{names.token}"\n', encoding="ascii")
        objects = [build.compile(NATIVE / name) for name in ("runtime.c", f"fmi{version}.c")]
        library = build.path / f"{identifier}.so"
        build.link(objects, library, f"fmi{version}*")
        files = {
            "modelDescription.xml": description(part, variables, names, version),
            f"{BINARIES[version]}/{identifier}.so": library.read_bytes(),
            "documentation/index.html": _page(part, variables).encode(),
            "resources/run_config.json": to_json(config).encode(),
        }
    write_archive(out, files)
    return part


def write_archive(path: Path, files: Mapping[str, bytes]) -> None:
    """Write a ZIP archive of files by name, with a fixed date. Raise ValueError if it cannot be written."""
    with write_errors(path), complete_file(path) as file, zipfile.ZipFile(file, "w") as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, ZIP_DATE), content, zipfile.ZIP_DEFLATED)


def _token(part: ExportedPart, variables: Sequence[Variable]) -> str:
    """Return a unique identifier of the model, {8-4-4-4-12} hexadecimal digits."""
    text = hashlib.blake2b(bytes(part.image.data) + repr(variables).encode(), digest_size=16).hexdigest()
    return f"{{{text[:8]}-{text[8:12]}-{text[12:16]}-{text[16:20]}-{text[20:]}}}"


def _page(part: ExportedPart, variables: Sequence[Variable]) -> str:
    """Return the documentation of the FMU as one HTML page."""
    config = part.config
    rows = "".join(
        f"<tr><td><code>{html.escape(v.name)}</code></td><td>{v.causality}</td><td>{v.type}</td>"
        f"<td>{html.escape(v.unit)}</td><td>{'' if v.start is None else f'{v.start:g}'}</td></tr>\n"
        for v in variables
        if v.causality in (kinds.INPUT, kinds.OUTPUT, kinds.PARAMETER)
    )
    recorded = (
        "<p>The flight manager of the autopilot is a recording of one run of the scene. It does not react to other"
        " events; the FMU logs a warning if one occurs.</p>"
        if part.actions
        else ""
    )
    return f"""<!doctype html>
<meta charset="utf-8"><title>{html.escape(config.scene)}: {part.name}</title>
<style>body {{ font: 15px sans-serif; max-width: 60em; margin: 2em auto }} td, th {{ text-align: left; padding: 0 1em }}
</style>
<h1>{html.escape(config.scene)}: {part.name}</h1>
<p>{html.escape(config.title)}</p>
{_picture(part)}
<p>One internal step takes {config.interval:g} s. At time k &times; {config.interval:g} s the outputs are those of
tick k.
An input that is set at that time is the sample of tick k for a port with a delay, and of tick k + 1 for a port
without one. Quantities are in SI units, the world frame is east-north-up, the body frame forward-left-up, and
quaternions are (w, x, y, z) from body to world.</p>
<p>Parameters are the numbers that the compiled step reads. Derived numbers, such as an inverse inertia, are separate
parameters: change them together.</p>
{recorded}
<table><tr><th>variable</th><th>causality</th><th>type</th><th>unit</th><th>start</th></tr>
{rows}</table>
"""


def _picture(part: ExportedPart) -> str:
    """Return an SVG diagram of the part with its ports."""
    inputs, outputs = [p.port.name for p in part.inputs], [p.port.name for p in part.outputs]
    height = 30 * max(len(inputs), len(outputs), 2) + 20
    arrows = [
        *((20, 180, 30 + 30 * k, name, 20) for k, name in enumerate(inputs)),
        *((380, 540, 30 + 30 * k, name, 400) for k, name in enumerate(outputs)),
    ]
    lines = "".join(
        f'<path d="M{a} {y}H{b}" stroke="black" marker-end="url(#tip)"/>'
        f'<text x="{x}" y="{y - 5}">{html.escape(n)}</text>'
        for a, b, y, n, x in arrows
    )
    return f"""<svg width="560" height="{height}" font-family="sans-serif" font-size="14">
<defs><marker id="tip" orient="auto" markerWidth="8" markerHeight="8" refX="8" refY="4">
<path d="M0 0L8 4L0 8z"/></marker></defs>
<rect x="182" y="5" width="198" height="{height - 10}" fill="#eef" stroke="black"/>
<text x="280" y="{height / 2 + 5}" text-anchor="middle">{part.name}</text>{lines}</svg>"""
