"""Resimulation of a run from its log: its run configuration, and its commands at the ticks of their execution."""

import json
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.cosim.config import user_module
from lapwing.cosim.config.provenance import CONFIG_FILE
from lapwing.cosim.config.run_config import PerVehicle, RunConfig, ServiceConfig
from lapwing.cosim.config.serialise import from_json
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.log import LogReader
from lapwing.fmi.importer.service_config import fmus_of
from lapwing.messages import OperatorInput
from lapwing.messages.topics import OPERATOR
from lapwing.runs.observer import Observer
from lapwing.runs.single_process_run import fly_single
from lapwing.services.common.firmware.playback import TOPICS, Recorded
from lapwing.services.common.firmware.schema import FIRMWARES
from lapwing.services.process_table import Operator


def recorded_config(read: LogReader, modules: Collection[str] = ()) -> RunConfig:
    """Return the run configuration of a log, which may contain classes of these modules.

    Raises:
        ValueError: the log has no run configuration, or one of another version.
    """
    if CONFIG_FILE not in read.attachments:
        raise ValueError(f"{read.path}: has no run configuration; expected a log of `lapwing run`")
    try:
        result = from_json(read.attachments[CONFIG_FILE].decode(), modules)
    except ValueError as error:
        raise ValueError(
            f"{read.path}: its run configuration cannot be read: {error}; expected {read.versions}"
        ) from None
    if not isinstance(result, RunConfig):
        raise ValueError(
            f"{read.path}: its attachment {CONFIG_FILE} is not a run configuration; expected a log of `lapwing run`"
        )
    return result


def carried_modules(read: LogReader) -> dict[str, str]:
    """Return the texts of the modules in the run configuration of a log by name, without importing its classes."""
    try:
        return dict(json.loads(read.attachments.get(CONFIG_FILE, b"{}"))["resolved"].get("modules", {}))
    except (ValueError, LookupError, TypeError, AttributeError):
        return {}


def recorded_commands(read: LogReader, config: RunConfig, vehicle: str = "") -> Iterator[tuple[int, tuple[Any, ...]]]:
    """Yield the operator commands with the ticks at which they applied; none if the vehicle accepts no commands.

    Args:
        read: log.
        config: run configuration of the log.
        vehicle: name; "" for the first.

    Raises:
        ValueError: the commands have the types of another version.
    """
    topic = OPERATOR.key(vehicle or config.vehicles[0])
    if topic not in read.topics():
        return
    read.check_versions([topic])
    for _, _, time_ns, payload in read.messages([topic]):
        yield time_ns // config.interval_ns, OperatorInput.decode(payload).commands


class RecordedRun(NamedTuple):
    """Run of a log, with all inputs of its resimulation."""

    config: RunConfig
    operators: dict[str, Operator]  # commands of each vehicle by name
    firmware: dict[str, Recorded]  # messages of each foreign firmware, by vehicle
    last: int  # tick
    digest: str
    repeats: bool  # the firmwares fly again: the log is repeatable, and all of its programs are on this machine


def recorded_run(log: Path, allow_code: bool = False) -> RecordedRun:
    """Return the run of a log up to the log's last tick.

    Args:
        log: log of a run.
        allow_code: True to run Python modules and FMUs of the log.

    Raises:
        ValueError: not the log of a run, it has code without `allow_code`, or it had an external service.
    """
    with LogReader(log) as read:
        modules = carried_modules(read)
        if modules and not allow_code:
            files = ", ".join(f"modules.{name}.py" for name in modules)
            raise ValueError(f"{log}: contains code of its author ({files}); read it, then use --allow-code to run it")
        user_module.install(modules)
        config = without_plan(recorded_config(read, modules))
        if not allow_code and (fmus := [fmu.path for each in members(config) for fmu in fmus_of(each.services)]):
            files = ", ".join(dict.fromkeys(fmus))
            raise ValueError(f"{log}: has FMUs, machine code of their authors ({files}); use --allow-code to run them")
        if external := read.metadata.get("external"):
            raise ValueError(f"{log}: cannot be resimulated: {external} was an external service")
        flown = [own.vehicle for own in members(config) if any(name in own.services for name in FIRMWARES)]
        recorded = {vehicle: _firmware_messages(read, config, vehicle) for vehicle in flown}
        operators = {vehicle: _at(dict(recorded_commands(read, config, vehicle))) for vehicle in config.vehicles}
        times = (time_ns for _, _, time_ns, _ in read.messages(read.deterministic_topics()))
        last = max((time_ns // config.interval_ns for time_ns in times), default=0)
        marks = [text for key, text in read.metadata.items() if key.rpartition("/")[2] == "repeatable"]
        adapters = [own.services[name] for own in members(config) for name in FIRMWARES if name in own.services]
        programs = all(shutil.which(each.parameters.command[0]) for each in adapters if each.parameters.command)
        repeats = bool(adapters) and set(marks) == {"yes"} and programs
        return RecordedRun(config, operators, recorded, last, read.digest(), repeats)


def resimulate(log: Path, observer: Observer | None = None, allow_code: bool = False) -> tuple[str, str]:
    """Return the digests of the log, and of the run resimulated up to the log's last tick.

    The firmware of a repeatable flight runs again, any other firmware's recorded motor commands are applied.

    Args:
        log: log of a run.
        observer: shows the progress.
        allow_code: True to run Python modules and FMUs of the log.

    Raises:
        ValueError: see `recorded_run`.
    """
    run = recorded_run(log, allow_code)
    with tempfile.TemporaryDirectory() as folder:
        new_log = Path(folder) / "again.mcap"
        recorded = {} if run.repeats else run.firmware
        fly_single(run.config, new_log, observer=observer, operator=run.operators, last=run.last, recorded=recorded)
        with LogReader(new_log) as read:
            return run.digest, read.digest()


def _firmware_messages(read: LogReader, config: RunConfig, vehicle: str) -> Recorded:
    """Return the messages of a firmware's adapter in a log."""
    keys = {topic.key(vehicle): topic for topic in TOPICS}
    result: Recorded = {topic: {} for topic in TOPICS}
    for key, _, time_ns, payload in read.messages([key for key in keys if key in read.topics()]):
        result[keys[key]][time_ns // config.interval_ns] = payload
    return result


def _at(commands: Mapping[int, tuple[Any, ...]]) -> Operator:
    return lambda tick: commands.get(tick, ())


def without_plan(config: RunConfig) -> RunConfig:
    """Return the run configuration without the plans' commands, which the log has among the accepted commands."""
    if "autopilot" not in config.services:
        return config
    own = config.services["autopilot"]
    if isinstance(fleet := own.parameters, PerVehicle):
        without = own._replace(parameters=fleet._replace(given=tuple(map(_without_plan, fleet.given))))
    else:
        without = _without_plan(own)
    return config._replace(services={**config.services, "autopilot": without})


def _without_plan(autopilot: ServiceConfig) -> ServiceConfig:
    return autopilot._replace(parameters=autopilot.parameters._replace(plan=()))
