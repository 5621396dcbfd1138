"""Figures of flights with real firmwares, for docs/appendix/firmware_flights.md.

PX4=PATH python -m tests.services.firmware_figures px4 --starts 20
ARDUCOPTER=PATH python -m tests.services.firmware_figures ardupilot --starts 20
BETAFLIGHT=PATH python -m tests.services.firmware_figures betaflight

python -m tests.services.firmware_figures ardupilot --scripted --set run.duration=15

Each start is a `lapwing run` of the scene that starts a new program; it receives `--set KEY=VALUE`. `--scripted` starts
the scripted program of the tests: its CPU time per exchange is meaningful, the share of Lapwing is not.
"""

import argparse
import json
import math
import os
import re
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

from lapwing.api.flight import Flight
from lapwing.services.common.schemas.vehicle_schema import airframe, gravity, thrust_coefficient
from lapwing.services.scene_resolver import load
from tests.commands import run_command

VARIABLES = {"px4": "PX4", "ardupilot": "ARDUCOPTER", "betaflight": "BETAFLIGHT"}
SCRIPTED = {"px4": "px4/scripted_px4.py", "ardupilot": "ardupilot/scripted_ardupilot.py"}
SQUARE = 10.0 * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)])  # [m] of the shipped missions
SLOW = 0.1  # [m/s] highest speed in hover
ALOFT = 1.0  # [m] lowest height above the start in flight


def overrides(firmware: str, program: str) -> list[str]:
    """Return the options of `lapwing run` that start a program; "" is the scripted program."""
    if not program:
        command = [sys.executable, str(Path(__file__).parent / SCRIPTED[firmware])]
        return ["--set", f"autopilot.command={json.dumps(command)}"]
    path = Path(program).resolve()
    if firmware == "px4":
        command = [str(path), "-d", str(path.parents[1] / "etc")]
        return ["--set", f"autopilot.command={json.dumps(command)}",
                "--set", 'autopilot.environment={PX4_SIM_MODEL="none_iris"}']  # fmt: skip
    arguments = ["127.0.0.1"] if firmware == "betaflight" else []
    return ["--set", f"autopilot.command={json.dumps([str(path), *arguments])}"]


def hover_duty(scene_name: str) -> float:
    """Return the motor output in hover from the airframe's constants: thrust k w^2, voltage K w."""
    scene = load(scene_name)
    frame = airframe(scene)
    speed = math.sqrt(frame.mass.total * gravity(scene) / len(frame.rotors.position) / thrust_coefficient(scene))
    return speed * frame.motor.rotor_constant / frame.motor.max_voltage


def distance_from_square(position: np.ndarray) -> np.ndarray:
    """Return the horizontal distances [m] of positions (n, 2) from the sides of the square."""
    best = np.full(len(position), np.inf)
    for a, b in pairwise(SQUARE):
        along = np.clip((position - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(position - a - along[:, None] * (b - a), axis=1))
    return best


def hovering_duty(flight: Flight, full: float) -> float:
    """Return the mean motor voltage over `full` [V] while the vehicle hovers; NaN if it never does."""
    truth = flight.truth
    slow = np.linalg.norm(truth.velocity, axis=1) < SLOW
    slow &= truth.position[:, 2] > truth.position[0, 2] + ALOFT
    return float(truth.motor_voltage[slow].mean() / full) if slow.any() else math.nan


def figures(log: Path, summary: Path, full: float) -> dict:
    """Return the figures of a flight."""
    flight, result = Flight.read(log), json.loads(summary.read_text())
    truth, report = flight.truth, "".join(result["firmware"])
    away = truth.position[:, :2] - truth.position[0, :2]
    aloft = truth.position[:, 2] > truth.position[0, 2] + ALOFT
    off = distance_from_square(away[aloft])

    def count(name: str) -> float:
        matches = re.search(rf"{name} ([\d.e+-]+)", report)
        return float(matches[1]) if matches else math.nan

    cpu = re.search(r"CPU ([\d.e+-]+) s of Lapwing and ([\d.e+-]+) s", report)
    steps = int(re.search(r"(\d+) steps", report)[1])
    return {
        "outcome": flight.outcome.kind,
        "text": str(flight.outcome),
        "landing": float(np.linalg.norm(away[-1])),
        "off_rms": float(np.sqrt((off**2).mean())) if len(off) else math.nan,
        "off_max": float(off.max()) if len(off) else math.nan,
        "hover": hovering_duty(flight, full),
        "steps": steps,
        **{name: count(name) for name in ("skew", "resent", "late", "missed", "rejected", "waiting")},
        "factor": result["real_time_factor"],
        "share": float(cpu[1]) / float(cpu[2]) if cpu else math.nan,
        "own_us": 1e6 * float(cpu[1]) / steps if cpu else math.nan,  # CPU time of an exchange
        "firmware_us": 1e6 * float(cpu[2]) / steps if cpu else math.nan,
        "load": os.getloadavg()[0],  # average of the last minute
        "digest": result["digest"],
    }


def fly(firmware: str, program: str, folder: Path, name: str, mode: str, *options: str) -> dict:
    """Fly once. Return the figures."""
    scene, log, summary = f"{firmware}_quad", folder / f"{name}.mcap", folder / f"{name}.json"
    done = run_command(
        "run", scene, "--mode", mode, "--log", log, "--json", summary, *overrides(firmware, program), *options
    )
    (folder / f"{name}.txt").write_text(done.stdout + done.stderr)
    if not summary.exists() or not summary.stat().st_size:
        return {"outcome": "failed", "text": done.stderr.strip()}
    return figures(log, summary, airframe(load(scene)).motor.max_voltage)


def main() -> None:
    """Fly, and print a line for each flight and a summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("firmware", choices=VARIABLES)
    parser.add_argument("--scripted", action="store_true", help="fly the scripted program of the tests")
    parser.add_argument("--starts", type=int, default=1)
    parser.add_argument("--mode", choices=["single-process", "multi-process"], default="single-process")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--out", type=Path)
    inputs = parser.parse_args()
    if inputs.scripted and inputs.firmware not in SCRIPTED:
        parser.error(f"--scripted: expected {' or '.join(SCRIPTED)}")
    program = "" if inputs.scripted else os.environ[VARIABLES[inputs.firmware]]
    folder = inputs.out or Path(tempfile.mkdtemp(prefix="lapwing_figures_"))
    folder.mkdir(parents=True, exist_ok=True)
    options = [part for value in inputs.set for part in ("--set", value)]
    results = []
    for k in range(inputs.starts):
        results.append(fly(inputs.firmware, program, folder, f"flight_{k}", inputs.mode, *options))
        print(json.dumps(results[-1]), flush=True)
    landed = [r for r in results if r["outcome"] == "landed"]
    completed = [r for r in results if r["outcome"] != "failed"] if inputs.scripted else landed
    print(f"{len(landed)} of {len(results)} landed; hover by the airframe {hover_duty(f'{inputs.firmware}_quad'):.4f}")
    for name in ("landing", "off_rms", "off_max", "hover", "steps", "skew", "missed", "waiting", "factor", "share",
                 "own_us", "firmware_us", "load"):  # fmt: skip
        values = [r[name] for r in completed]
        if values:
            print(f"{name:8} mean {np.mean(values):.4g}, least {min(values):.4g}, greatest {max(values):.4g}")
    print(f"{len({r['digest'] for r in completed})} different digests in {len(completed)} flights; logs in {folder}")


if __name__ == "__main__":
    main()
