"""Speed of campaigns on one core, and the overhead of a run relative to its flight, with compiled kernels.

The overhead is resolving the scene, creating and reading the block diagram, and computing metrics; each is printed.

    python -m benchmarks.campaign [--runs N]
"""

import time
from contextlib import ExitStack, contextmanager
from statistics import median

import lapwing.studies.simulate
from benchmarks._command import command_line
from benchmarks._targets import Row, show
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.flights.flight_data import FlightData
from lapwing.studies.campaign import runs as campaign_runs
from lapwing.studies.campaign.distributions import parse
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.runs import row_of

SCENE = "delivery_mission"
VARIED = {"vehicle.mass": parse("normal(10.4, 0.2)"), "effects.random_wind_force.mean.0": parse("uniform(0, 12)")}
FLIGHT = "flight"
PARTS = {
    "scene and configuration": (campaign_runs, "setup_of"),
    "services": (lapwing.studies.simulate, "create_all"),
    "graph": (lapwing.studies.simulate, "BlockDiagram"),
    FLIGHT: (BlockDiagram, "advance"),
    "rows as columns": (FlightData, "of_each"),
    "metrics": (campaign_runs, "metrics"),
}
"""Parts of a run: name and functions."""


def main(runs: int = 20) -> list[Row]:
    seconds, overhead, simulated = measure(plan(SCENE, runs=runs))
    _, varied_overhead, _ = measure(plan(SCENE, runs=runs, vary=VARIED))
    result = [
        Row("closed-loop campaign, one core, to real time", simulated / seconds, "", 1500.0, True),
        Row("campaign: overhead of a run, seed only", 100.0 * overhead, "%", 5.0),
        Row("campaign: overhead of a run, mass and wind drawn", 100.0 * varied_overhead, "%", 5.0),
    ]
    return show(result)


def measure(options):
    """Return processor time [s], ratio of other work to the flight, and simulated time [s] of the runs of a plan."""
    rows, total, simulated = {}, [], 0.0
    row_of(options, 0, rows)  # loads compiled kernels
    with ExitStack() as stack:
        spent = {part: stack.enter_context(timed(*place)) for part, place in PARTS.items()}
        for run in range(options.runs):
            began = time.process_time()
            simulated += row_of(options, run, rows)["duration"]
            total.append(time.process_time() - began)
    print(", ".join(f"{part} {1e3 * median(times):.2f} ms" for part, times in spent.items()), flush=True)
    overhead = median((whole - flight) / flight for whole, flight in zip(total, spent[FLIGHT], strict=True))
    return sum(total), overhead, simulated


@contextmanager
def timed(of, name):
    """Record the processor time [s] of each call of a function in the returned list."""
    function, spent = getattr(of, name), []

    def call(*args, **kwargs):
        began = time.process_time()
        result = function(*args, **kwargs)
        spent.append(time.process_time() - began)
        return result

    setattr(of, name, call)
    try:
        yield spent
    finally:
        setattr(of, name, function)


if __name__ == "__main__":
    command_line(main)
