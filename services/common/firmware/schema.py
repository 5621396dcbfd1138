"""Keys of `[autopilot]` that choose a foreign firmware."""

import re
from typing import Any, Literal

from pydantic import Field

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError

OWN = "lapwing"
FIRMWARES = ("px4", "ardupilot", "betaflight")
TABLE = "autopilot"
_LINE = re.compile(r"(?:\d+\s+\d+\s+)?([A-Za-z]\w*)[\s,=]+([-+.\deE]+)")  # of ArduPilot, and of QGroundControl


class FirmwareKeys(SceneTable):
    """Firmware in the loop, and the program that runs it."""

    firmware: Literal["lapwing", "px4", "ardupilot", "betaflight"] = "lapwing"  # program that flies the vehicle
    command: list[str] = Field(default_factory=list)  # program and arguments; empty: wait for one started elsewhere
    directory: str | None = None  # its working directory; unset: a temporary one
    environment: dict[str, str] = Field(default_factory=dict)  # environment variables of the program
    host: str = "127.0.0.1"  # address of the firmware's links
    port: int | None = Field(default=None, gt=0, lt=65536)  # first port of its links; unset: the firmware's default
    instance: int | None = Field(default=None, ge=0, lt=100)  # shifts ports; unset: number of the vehicle
    start_timeout: float = Field(default=60.0, gt=0.0)  # [s] until the firmware answers, without time it had no CPU
    step_timeout: float = Field(default=10.0, gt=0.0)  # [s] of silence in flight, without time it had no CPU
    repeatable: bool = True  # two flights are equal: the threads of a program that Lapwing starts run in turns
    schedule: int = Field(default=0, ge=0, lt=1 << 63)  # seed of the order of its threads; 0: in turn
    shell: bool = False  # standard input and output of the command are also those of the program
    parameter_text: str = ""  # content of the file that `parameters` names

    @classmethod
    def embed_parameters(cls, tree: dict[str, Any], files: Files) -> None:
        """Store the content of a foreign firmware's parameter file."""
        if isinstance(file := unvalidated_value(tree, TABLE, "parameters"), str):
            key = f"{TABLE}.parameters"
            text = files.text(key, key, files.path(key, file))
            tree[TABLE] |= {"parameters": {}, "parameter_text": text}

    def check_own(self) -> None:
        """Raise ConfigError if a key of another firmware is set for Lapwing's own autopilot."""
        for key in ("command", "directory", "environment", "port", "instance", "shell", "parameter_text"):
            if getattr(self, key):
                raise ConfigError(f"{TABLE}.{key}", "is not used", f"{TABLE}.firmware = one of {', '.join(FIRMWARES)}")


def is_foreign(tree: dict[str, Any]) -> bool:
    """Return True if a scene's data, not yet validated, names a foreign firmware."""
    return unvalidated_value(tree, TABLE, "firmware", OWN) in FIRMWARES


def firmware_of(scene: Scene) -> str:
    """Return the firmware that flies the vehicle, "" without an autopilot."""
    return str(scene.lookup(f"{TABLE}.firmware")) if scene.has(TABLE) else ""


def flown_by_firmware(scene: Scene) -> bool:
    """Return True if a foreign firmware flies the vehicle."""
    return firmware_of(scene) in FIRMWARES


def require_program(scene: Scene) -> None:
    """Raise ValueError if a foreign firmware flies the vehicle and a study of many flights cannot start its program."""
    if flown_by_firmware(scene) and not scene.section(TABLE).command:
        fault = f"each flight starts {firmware_of(scene)}; expected the program and its arguments, a list of texts"
        raise ValueError(f"{scene.path}: {TABLE}.command: {fault}")


def parameters_in(text: str) -> dict[str, float]:
    """Return the parameters in a file of a ground station: lines "NAME VALUE" or "1 1 NAME VALUE TYPE"."""
    found = (_LINE.match(line.strip()) for line in text.splitlines())
    return {match[1]: float(match[2]) for match in found if match}
