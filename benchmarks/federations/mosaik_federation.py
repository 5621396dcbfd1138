"""Mosaik scenario with its simulators as processes: python -m ... broker CYCLES CORE PORT, or NAME HOST:PORT."""

import json
import sys
import time

import mosaik
import mosaik_api_v3

from benchmarks.federations import PATIENCE, pin
from benchmarks.lockstep import PARTS
from lapwing.kernels.row_packing import pack_row

MODULE = "benchmarks.federations.mosaik_federation"
LATER = ("plant", "trajectory")  # inputs from an earlier tick


class Simulator(mosaik_api_v3.Simulator):
    """Process that publishes the same numbers at every tick."""

    def __init__(self, name):
        self.name = name
        self.inputs, self.outputs = PARTS[self.name]
        attributes = [*(i.port for i in self.inputs), *(p.name for p in self.outputs)]
        model = {"public": True, "params": [], "attrs": attributes}
        super().__init__({"type": "time-based", "models": {"Service": model}})
        self.values = {p.name: pack_row(p.like).tolist() for p in self.outputs}
        self.stamps = []

    def init(self, sid, time_resolution=1.0, **sim_params):
        return self.meta

    def create(self, num, model, **model_params):
        return [{"eid": self.name, "type": model}]

    def step(self, time_, inputs, max_advance):
        self.stamps.append(time.perf_counter())
        return time_ + 1

    def get_data(self, outputs):
        return {eid: {name: self.values[name] for name in names} for eid, names in outputs.items()}

    def finalize(self):
        if self.name == "plant":
            print(json.dumps(self.stamps), flush=True)


def scenario(cycles, port):
    """Start and connect the simulators, and run the scenario."""
    commands = {name: {"cmd": f"{sys.executable} -m {MODULE} {name} %(addr)s"} for name in PARTS}
    with mosaik.World(commands, mosaik_config={"addr": ("127.0.0.1", port), "start_timeout": PATIENCE}) as world:
        entities = {name: world.start(name).Service.create(1)[0] for name in PARTS}
        source = {p.name: (name, p) for name, (_, outputs) in PARTS.items() for p in outputs}
        for name, (inputs, _) in PARTS.items():
            for i in inputs:
                giver, value = source[i.port]
                first = {"time_shifted": True, "initial_data": {i.port: pack_row(value.like).tolist()}}
                world.connect(entities[giver], entities[name], i.port, **(first if name in LATER else {}))
        world.run(until=cycles, print_progress=False)


if __name__ == "__main__":
    if sys.argv[1] == "broker":
        cycles, core, port = map(json.loads, sys.argv[2:])
        pin(core)
        scenario(cycles, port)
    else:
        mosaik_api_v3.start_simulation(Simulator(sys.argv.pop(1)))  # which reads the remaining arguments
