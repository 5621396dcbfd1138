"""Options of `lapwing run`, validated before any file is read or process started."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lapwing.cosim.scene import Scene

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import typer

from lapwing.cli.options import KeyPrefix, Keys, LinkOptions, Overrides, PlanFiles, SceneFile, parse_speed


def check_endpoints(option: str, endpoints: Iterable[str], keys: Path | None, insecure: bool) -> None:
    """Raise ValueError for a Zenoh endpoint without authentication, unless `insecure`."""
    for endpoint in endpoints:
        kind = endpoint.partition("/")[0]
        if kind == "tls" and not keys:
            raise ValueError(
                f"{option} {endpoint}: needs certificates; use --keys FOLDER (made by `lapwing certificates FOLDER`)"
            )
        if kind not in ("tls", "unixsock-stream") and not insecure:
            expected = "use tls/HOST:PORT with --keys FOLDER, or --insecure"
            raise ValueError(f"{option} {endpoint}: endpoint is not authenticated; {expected}")


def check_published(option: str, endpoint: str, insecure: bool) -> None:
    """Raise ValueError for a Zenoh endpoint that other machines can reach without authentication."""
    from lapwing.runs.distributed_run import check_endpoint
    from lapwing.services.common.address import is_loopback

    check_endpoint(option, endpoint)
    kind, _, address = endpoint.partition("/")
    if kind != "unixsock-stream" and not is_loopback(address.rpartition(":")[0].strip("[]")) and not insecure:
        expected = "use a loopback address, e.g. tcp/127.0.0.1:7447, or --insecure"
        raise ValueError(f"{option} {endpoint}: endpoint is not authenticated; {expected}")


def check_external(texts: Iterable[str], insecure: bool) -> None:
    """Raise ValueError for an external service at an endpoint that other users could occupy, unless `insecure`."""
    for text in texts:
        if "=unixsock-stream/" not in text and not insecure:
            expected = "use unixsock-stream/PATH in a folder of your own, or --insecure"
            raise ValueError(f"--external {text}: endpoint is not authenticated; {expected}")


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


def plan_overrides(plans: list[str], scene: Path, set_: list[str]) -> list[str]:
    """Return the overrides for vehicles with plans: they accept commands and do not follow the trajectory.

    Raises:
        ValueError: a plan without the name of a vehicle, or with an unknown name.
        SceneError: the scene is invalid.
    """
    from lapwing.services.common.plans.plan_file import OPERATED
    from lapwing.services.scene_resolver import load

    if not plans:
        return []
    base = load(scene, set_)
    if not base.vehicles:
        plan_files(plans, base)
        return OPERATED
    names = [vehicle.lookup("vehicle.name") for vehicle in base.vehicles]
    return [f"vehicle.{names.index(name)}.{text}" for name in plan_files(plans, base) for text in OPERATED]


def plan_commands(
    plans: list[str], loaded: "Scene", report: Callable[[str], None] = lambda line: None
) -> Mapping[str, tuple[Any, ...]]:
    """Return the commands of each vehicle that flies a plan, by name. See `plan_overrides` for errors.

    Args:
        plans: values of --plan.
        loaded: the scene.
        report: called with a line for each kind of items that are skipped, or flown in another way.
    """
    from lapwing.services.common.plans.plan_file import read, site_of

    scenes = {scene.lookup("vehicle.name"): scene for scene in loaded.each_vehicle}
    result = {}
    for name, path in plan_files(plans, loaded).items():
        plan = read(path, site_of(scenes[name]))
        for note in plan.notes:
            report(f"{path}: {note}")
        result[name] = plan.commands
    return result


def plan_files(plans: list[str], loaded: "Scene") -> dict[str, Path]:
    """Return the plan of each vehicle that flies one, by name. See `plan_overrides` for errors."""
    if not loaded.vehicles:
        if len(plans) > 1:
            raise ValueError(f"--plan {plans[1]}: expected one plan, the scene has one vehicle")
        return {loaded.lookup("vehicle.name"): Path(path) for path in plans}
    names = [vehicle.lookup("vehicle.name") for vehicle in loaded.vehicles]
    result: dict[str, Path] = {}
    for text in plans:
        name, equals, path = text.partition("=")
        if not equals or name not in names or name in result:
            expected = f"NAME=FILE, a plan for each of {', '.join(names)} that flies one"
            fault = "the scene has several vehicles"
            if equals:
                fault = f"{name} has a plan already" if name in result else f"the scene has no vehicle {name}"
            raise ValueError(f"--plan {text}: {fault}; expected {expected}")
        result[name] = Path(path)
    return result
