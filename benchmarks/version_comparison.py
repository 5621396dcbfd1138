"""Waiting times compared with the first version of Lapwing on the same machine.

    python -m benchmarks.version_comparison [REPEATS]

The first version is a commit of this repository, installed into an environment of its own. To compile takes the
processor time of a command with an empty cache less that of the same command once more.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import NamedTuple

from benchmarks._targets import LAPWING, Row, empty_cache, show

SLOW = True  # left out by `python -m benchmarks --quick`
ROOT = Path(__file__).parent.parent
FIRST = "9e0d48d428677c02af5b5eaa555417742657c322"

HOVER, MISSION = "lapwing/scenes/hover.toml", "lapwing/scenes/delivery_mission.toml"
EULER = ["--set", "vehicle.model=multibody", "--set", "multibody.coordinates=euler", "--set", "run.duration=0.1"]
FAILED = 4  # of a run: its flight ended otherwise than it should, as one of a tenth of a second does


class Version(NamedTuple):
    """Commands of one version of the program."""

    folder: Path
    lapwing: list[str]
    run: list[str]  # what every run is told
    effect: list[str]  # one more effect
    campaign: list[str]  # of one seed
    modes: tuple[str, str]  # values of --mode: one process, a process for each service


class Taken(NamedTuple):
    """By one command."""

    wall: float  # [s]
    processor: float  # [s] of all its processes
    factor: float  # of real time, of a run


def took(version, environment, command, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        figures = Path(folder, "figures.json")
        if command == "run":
            arguments += (*version.run, "--log", f"{folder}/log.mcap", "--json", str(figures))
        elif command == "campaign":
            arguments += tuple(a.format(folder=folder) for a in version.campaign)
        began, wall = os.times(), time.perf_counter()
        ran = subprocess.run([*version.lapwing, command, *arguments], cwd=version.folder, env=environment, check=False,
                             stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)  # fmt: skip
        wall, ended = time.perf_counter() - wall, os.times()
        assert ran.returncode in (0, FAILED), ran.stderr
        processor = sum(ended[2:4]) - sum(began[2:4])
        factor = json.loads(figures.read_text())["real_time_factor"] if command == "run" else 0.0
        return Taken(wall, processor, factor)


def compiled(version, environment, *arguments):
    """Processor time [s] to compile what a command needs and the cache does not have."""
    return took(version, environment, *arguments).processor - took(version, environment, *arguments).processor


def compile_times(version):
    """By what is compiled [s]."""
    single = ("--mode", version.modes[0])
    with empty_cache() as environment:
        yield "hover", compiled(version, environment, "run", HOVER, *single)
    with empty_cache() as environment:
        yield "the mission", compiled(version, environment, "run", MISSION, *single)
        yield "one more effect", compiled(version, environment, "run", MISSION, *single, *version.effect)
        yield "the mission's closed loop", compiled(version, environment, "campaign", MISSION)
    with empty_cache() as environment:
        yield "five bodies in Euler angles", compiled(version, environment, "run", MISSION, *single, *EULER)


def flights(version, repeats):
    """By what is flown, kernels compiled before: seconds of the whole command, or the factor of real time."""
    for mode, value in zip(("single", "processes"), version.modes, strict=True):
        for scene in (HOVER, MISSION):
            taken = [took(version, None, "run", scene, "--mode", value) for _ in range(repeats + 1)][1:]
            if scene == HOVER:
                yield f"hover, {mode}, the whole command", median(t.wall for t in taken)
            else:
                yield f"the mission, {mode}, to real time", median(t.factor for t in taken)


# What the state before the first version's rewriting took, and what was asked of it, both on one machine.
BARS = {
    "hover": (32, 12), "the mission": (79, 30), "one more effect": (20, 7), "the mission's closed loop": (29, 12),
    "five bodies in Euler angles": (480, 40),
    "hover, single, the whole command": (5.3, 1.6), "hover, processes, the whole command": (12.6, 3.5),
    "the mission, single, to real time": (22, 150), "the mission, processes, to real time": (1, 3),
}  # fmt: skip


def versions(folder):
    first = Path(folder, "first")
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(first)], check=True)
    subprocess.run(["git", "checkout", "--quiet", FIRST], cwd=first, check=True)
    subprocess.run(["make", "--silent", ".venv/.installed"], cwd=first, check=True)
    drag = ["--set", "effects.body_drag.area=[0.06,0.06,0.06]"]
    beside = ["--set", "effects.random_wind_force.allow_body_drag=true"]
    return (
        Version(first, [str(first / ".venv/bin/lapwing")], ["--space", "benchmark"], drag, ["--seeds", "1"],
                ("single", "processes")),
        Version(ROOT, LAPWING, ["--key-prefix", "benchmark"], [*drag, *beside],
                ["--runs", "1", "--workers", "1", "--out", "{folder}/campaign"],
                ("single-process", "multi-process")),
    )  # fmt: skip


def rows(repeats=3):
    with tempfile.TemporaryDirectory() as folder:
        both = versions(folder)
        for measure in (compile_times, lambda version: flights(version, repeats)):
            for (what, before), (_, now) in zip(*map(measure, both), strict=True):
                had, asked = BARS[what]
                print(f"{what}: {before:.3g} before, {now:.3g} now", flush=True)
                yield Row(f"{what}, to the first version", now / before, "", asked / had, asked > had)


def main(repeats=3):
    result = list(rows(repeats))
    show(result)
    return result


if __name__ == "__main__":
    main(*[int(a) for a in sys.argv[1:]])
