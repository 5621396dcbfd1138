"""`lapwing autopilot`: Lapwing's autopilot on a foreign simulator."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.options import Overrides, SceneFile
from lapwing.cli.output_paths import check_log, remove_on_failure, reserve_log


@app.command()
def autopilot(
    scene: SceneFile,
    px4_sim: Annotated[str, typer.Option(metavar="HOST:PORT", help="address of the simulator")],
    set_: Overrides = None,
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="MCAP log to write")] = None,
) -> None:
    """Fly a scene's autopilot over PX4's simulator interface.

    The simulator replaces the plant and the sensors of the scene.

    Exit codes: 1 the run failed, 2 invalid input.
    """
    from lapwing.cli.progress import RunProgress
    from lapwing.cosim.log import LogReader
    from lapwing.runs.foreign_simulator_run import on_simulator, services
    from lapwing.runs.single_process_run import fly_single
    from lapwing.services.scene_resolver import load, resolve
    from lapwing.studies.terminal import console

    host, port = _address(px4_sim)
    loaded = load(scene, set_ or [])
    with loaded.located():
        setup = on_simulator(loaded, resolve(loaded), host, port)
    path = log or reserve_log(loaded.name)
    check_log(path)
    sources = {name: content.decode() for name, content in loaded.sources.items()}
    with remove_on_failure(path), RunProgress(console(), setup.duration) as display:
        elapsed = fly_single(setup, path, sources, observer=display, services=services(setup))
    typer.echo(f"{elapsed.simulated:.1f} s flown in {elapsed.wall:.1f} s")
    with LogReader(path) as read:
        for key in ("firmware", "firmware_notes"):
            if text := read.metadata.get(key):
                typer.echo(text)
    typer.echo(f"log     {path}")


def _address(text: str) -> tuple[str, int]:
    """Return host and port of HOST:PORT."""
    host, _, port = text.rpartition(":")
    if not host or not port.isascii() or not port.isdigit() or not 0 < int(port) < 65536:
        raise ValueError(f"--px4-sim {text}: expected HOST:PORT, for example 127.0.0.1:4560")
    return host, int(port)
