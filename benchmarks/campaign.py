"""How fast campaigns fly on one core, and what a run takes besides its flight, with kernels compiled before.

Besides its flight a run takes resolving the scene, making and reading its graph, and its figures.

python -m benchmarks.campaign [RUNS]
"""

import sys
import time
from statistics import median

from benchmarks._bars import Row, show
from cosim.graph import Graph
from studies.campaign.distributions import parse
from studies.campaign.plan import plan
from studies.campaign.runs import row_of

SCENE = "delivery_mission"
VARIED = {"vehicle.mass": parse("normal(10.4, 0.2)"), "effects.wind_random.mean.0": parse("uniform(0, 12)")}


def main(runs=20):
    seconds, besides, simulated = flown(plan(SCENE, runs=runs))
    _, besides_varied, _ = flown(plan(SCENE, runs=runs, vary=VARIED))
    found = [
        Row("closed-loop campaign, one core, to real time", simulated / seconds, "", 1500.0, True),
        Row("campaign: a run besides its flight, seed only", 100.0 * besides, "%", 5.0),
        Row("campaign: a run besides its flight, mass and wind drawn", 100.0 * besides_varied, "%", 5.0),
    ]
    show(found)
    return found


def flown(given):
    """Of the runs of a plan: processor time [s], what a run takes besides its flight to the flight, time flown [s]."""
    advance, spent, rows = Graph.advance, [], {}
    row_of(given, 0, rows)  # loads what is compiled

    def timed(graph, stop):
        began = time.process_time()
        advance(graph, stop)
        spent.append(time.process_time() - began)

    Graph.advance, total, simulated = timed, [], 0.0
    try:
        for run in range(given.runs):
            began = time.process_time()
            simulated += row_of(given, run, rows)["duration"]
            total.append(time.process_time() - began)
    finally:
        Graph.advance = advance
    besides = median((whole - flight) / flight for whole, flight in zip(total, spent, strict=True))
    return sum(total), besides, simulated


if __name__ == "__main__":
    main(*[int(a) for a in sys.argv[1:]])
