"""Ten hours of the gyrostat: time of 60 000 steps of RKMK4 and of the cheapest runs, with their errors."""

from lapwing.studies.accuracy.coordinates import of_state
from lapwing.studies.accuracy.integrate import solver_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.reference import DOP853, dop853
from lapwing.studies.accuracy.systems import gyrostat
from lapwing.studies.accuracy.work_precision import Point, measure

DURATION = 600.0  # [min]
SEED_STEPS = 60_000  # number of steps of 0.01 min
LEVELS = (1e-2, 1e-4, 1e-6, 1e-8)
CASES = {
    "rotors blocked": gyrostat.BLOCKED,
    "rotors spinning": gyrostat.SPINNING,
    "friction": gyrostat.FRICTION,
    "friction and feedback": gyrostat.FEEDBACK,
}


def problem(name: str) -> Problem:
    p = CASES[name]
    # one of the numbers of steps is that of the paper
    return Problem(
        f"gyrostat, {name}", "min", DURATION, solver_methods(p, gyrostat.START, DURATION, SEED_STEPS // 32),
        lambda: dop853(lambda t, y: gyrostat.right_hand_side(p, t, y), of_state(gyrostat.START), DURATION),
        DOP853, {},
    )  # fmt: skip


def text(point: Point | None) -> str:
    return f"{point.method} {1e3 * point.time:.2g} ({point.error:.0e})" if point else "-"


def main() -> None:
    print(f"\nten hours of gyrostat: method, ms of compiled time (error)\n{'case':24}{'60 000 steps':>32}"
          + "".join(f"{level:>32.0e}" for level in LEVELS))  # fmt: skip
    for name in CASES:
        points = measure(problem(name))
        of_seed = [p for p in points if p.method == "rkmk4" and abs(p.setting - DURATION / SEED_STEPS) < 1e-9]
        cells: list[Point | None] = [*of_seed] or [None]  # none if fewer steps reach round-off
        for level in LEVELS:
            cells.append(min((p for p in points if p.error <= level), key=lambda p: p.time, default=None))
        print(f"{name:24}" + "".join(f"{text(p):>32}" for p in cells))
