"""Processes of a HELICS federation: python -m ... broker|NAME CYCLES CORE PORT."""

import json
import sys
import time

import helics

from benchmarks.federations import PATIENCE, pin
from benchmarks.lockstep import PARTS
from lapwing.kernels.row_packing import row_width

WIDTH = {port.name: 8 * row_width(port.like) for _, outputs in PARTS.values() for port in outputs}  # [bytes]
OFFSET = {"plant": 0.0, "sensors": 0.25, "trajectory": 0.25, "autopilot": 0.5}  # [s] of its step in a cycle of 1 s


def broker(port):
    """Run the broker until all federates have disconnected."""
    handle = helics.helicsCreateBroker("zmq", "bench", f"-f {len(PARTS)} --port={port} --loglevel=error")
    helics.helicsBrokerWaitForDisconnect(handle, int(1e3 * PATIENCE))


def federate(name, cycles, port):
    """Read inputs and publish outputs at every second."""
    inputs, outputs = PARTS[name]
    info = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreTypeFromString(info, "zmq")
    helics.helicsFederateInfoSetCoreInitString(info, f"--federates=1 --broker_address=tcp://127.0.0.1:{port}")
    for key, seconds in ((helics.HELICS_PROPERTY_TIME_PERIOD, 1.0), (helics.HELICS_PROPERTY_TIME_OFFSET, OFFSET[name])):
        helics.helicsFederateInfoSetTimeProperty(info, key, seconds)
    helics.helicsFederateInfoSetFlagOption(info, helics.HELICS_FLAG_UNINTERRUPTIBLE, True)
    fed = helics.helicsCreateValueFederate(name, info)
    raw = helics.HELICS_DATA_TYPE_RAW
    value = [
        (helics.helicsFederateRegisterGlobalPublication(fed, p.name, raw, ""), bytes(WIDTH[p.name])) for p in outputs
    ]
    subscriptions = [(helics.helicsFederateRegisterSubscription(fed, i.port, ""), WIDTH[i.port]) for i in inputs]
    helics.helicsFederateEnterExecutingMode(fed)
    stamps = []
    for tick in range(1, cycles + 1):
        helics.helicsFederateRequestTime(fed, tick + OFFSET[name])
        for subscription, size in subscriptions:
            result = helics.helicsInputGetBytes(subscription)
            assert tick < 3 or len(result) == size
        for publication, payload in value:
            helics.helicsPublicationPublishBytes(publication, payload)
        stamps.append(time.perf_counter())
    helics.helicsFederateDisconnect(fed)
    if name == "plant":
        print(json.dumps(stamps), flush=True)


if __name__ == "__main__":
    role, cycles, core, port = sys.argv[1], *map(json.loads, sys.argv[2:])
    pin(core)
    broker(port) if role == "broker" else federate(role, cycles, port)
