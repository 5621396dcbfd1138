"""Options of `lapwing run`, validated before any file is read or process started."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.endpoint_checks import check_endpoints, check_external
from lapwing.cli.options import KeyPrefix, Keys, LinkOptions, Overrides, PlanFiles, SceneFile, parse_speed

MULTI_PROCESS, SINGLE_PROCESS = "multi-process", "single-process"
ALTERNATIVES = {  # options of a run that starts its own processes, and what to use in other runs
    "--mavlink": "with --endpoints start the service mavlink instead",
    "--ros2": "with --endpoints start the service ros2 instead",
    "--external": "with --endpoints, add an endpoint NAME_messages",
    "--foxglove": "with --endpoints start the service foxglove instead; lapwing replay shows a log",
    "--view": "lapwing view shows the log of other runs",
    "--realtime": f"--mode {SINGLE_PROCESS} keeps a --speed without it",
}


@dataclass(frozen=True, kw_only=True)
class RunOptions(LinkOptions):
    """Options of `lapwing run`; each default leaves the choice to the scene."""

    scene: SceneFile
    set_: Overrides = None
    plan: PlanFiles = None
    speed: Annotated[
        str | None,
        typer.Option(metavar="1|N|max", help="simulated seconds per second; max: unlimited [run.real_time_factor]"),
    ] = None
    realtime: Annotated[
        bool, typer.Option("--realtime", help="fly at speed 1, in the real-time scheduling class where permitted")
    ] = False
    mode: Annotated[
        str | None,
        typer.Option(
            metavar="multi-process|single-process",
            help="a process for each service, or one for all [single-process if a firmware flies]",
        ),
    ] = None
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="MCAP log [recordings/SCENE_TIME.mcap]")] = None
    report: Annotated[Path | None, typer.Option(metavar="FILE.html|pdf|png", help="report [.html next to log]")] = None
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="write the results as JSON")] = None
    view: Annotated[bool, typer.Option("--view", help="show the flight live in the browser")] = False
    run_: Annotated[int | None, typer.Option("--run", metavar="N", help="repeat run N of --campaign")] = None
    campaign: Annotated[Path | None, typer.Option(metavar="DIR", help="campaign folder for --run")] = None
    key_prefix: KeyPrefix = "lapwing"
    listen: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="accept Zenoh clients here, e.g. tls/127.0.0.1:7447")
    ] = None
    endpoints: Annotated[
        str | None, typer.Option(metavar="TABLE", help="name=endpoint,... of all participants, when started separately")
    ] = None
    external: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=ENDPOINT", help="service run by your own program, at this endpoint (repeatable)"),
    ] = None
    keys: Keys = None
    firmware_schedule: Annotated[
        int | None, typer.Option(metavar="SEED", help="order of the firmware's threads [autopilot.schedule]")
    ] = None
    shell: Annotated[
        bool, typer.Option("--shell", help="connect the firmware's console, in one process; see also --speed")
    ] = False
    force: Annotated[bool, typer.Option("--force", help="fly even if the gains make a loop unstable in hover")] = False
    allow_code: Annotated[bool, typer.Option("--allow-code", help="allow FMUs of the scene to run")] = False

    @property
    def table(self) -> dict[str, str] | None:
        """Endpoints by participant, None without `--endpoints`. Raises ValueError if malformed."""
        from lapwing.runs.distributed_run import parse_endpoints

        return None if self.endpoints is None else parse_endpoints(self.endpoints)

    def validate(self) -> None:
        """Raise ValueError for options that are malformed, unsafe, or incompatible."""
        from lapwing.runs.distributed_run import check_endpoint

        self.validate_mode()
        parse_speed(self.speed)
        if self.realtime and self.speed == "max":
            raise ValueError("--realtime: needs a limited speed; leave out --speed max")
        if self.listen is not None:
            check_endpoint("--listen", self.listen)
            check_endpoints("--listen", [self.listen], self.keys, self.insecure)
        table = self.table
        check_endpoints("--endpoints", (table or {}).values(), self.keys, self.insecure)
        if self.keys and self.listen is None and table is None:
            raise ValueError("--keys: expected with --listen or --endpoints")
        check_external(self.external or [], self.insecure)
        self.validate_links()
        if self.view:
            from lapwing.views.view3d import available

            if not available():
                raise ValueError("--view: viser is not installed; pip install lapwing[view3d]")
        if (self.run_ is None) != (self.campaign is None):
            raise ValueError("--run and --campaign: belong together; expected both")

    def validate_mode(self) -> None:
        """Raise ValueError for an unknown mode, and for options that the mode does not support."""
        if self.mode not in (None, MULTI_PROCESS, SINGLE_PROCESS):
            raise ValueError(f"--mode {self.mode}: expected {MULTI_PROCESS} or {SINGLE_PROCESS}")
        single, distributed = self.mode == SINGLE_PROCESS, self.endpoints is not None
        if single and (distributed or self.listen is not None):
            raise ValueError(f"--mode {SINGLE_PROCESS}: has no network; leave out --endpoints and --listen")
        for option in self._for_processes:
            if single or (distributed and option != "--view"):
                raise ValueError(f"{option}: needs --mode {MULTI_PROCESS}; {ALTERNATIVES[option]}")

    @property
    def _for_processes(self) -> list[str]:
        """Return the given options that need a process for each service, without those of the network."""
        requested = {
            "--mavlink": self.mavlink,
            "--external": self.external,
            "--foxglove": self.foxglove,
            "--view": self.view,
            "--realtime": self.realtime,
            "--ros2": self.ros2 is not None,
        }
        return [option for option, value in requested.items() if value]

    def mode_of(self, firmware: bool) -> str:
        """Return the mode; by default one process if a firmware flies, because that is several times faster."""
        processes = self._for_processes or self.listen is not None or self.endpoints is not None
        return self.mode or (SINGLE_PROCESS if firmware and not processes else MULTI_PROCESS)
