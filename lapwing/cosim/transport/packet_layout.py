"""Layout of the step packets of a run, for programs in other languages: the columns of each port by name."""

from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import to_json
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, BATCH_KEY, SETUP_KEY, STEP_KEY, WAITING_KEY


def columns(like: Any, name: str = "") -> list[str]:
    """Return the columns of a port in their order: "position_world.0", "armed"."""
    if not isinstance(like, tuple):
        return [name]
    fields = getattr(like, "_fields", range(len(like)))
    parts = zip(fields, like, strict=True)
    return [column for field, part in parts for column in columns(part, f"{name}.{field}" if name else str(field))]


def layout(setup: RunConfig) -> dict[str, Any]:
    """Return ports, periods and columns of all services as a tree for JSON.

    Returns:
        "rate" [Hz], "interval_ns", "last_tick", "order" (of the services within a tick), "keys" (the first parts of
        their keys, by purpose), "services" (by name: "inputs", each with "port" and "delay" [ticks], and "ports" in the
        order of a step packet, each with "name", "period" [ticks] and "columns"), and "setup", the text of the run
        configuration.
    """
    return {
        "rate": setup.rate,
        "interval_ns": setup.interval_ns,
        "last_tick": setup.last_tick,
        "order": setup.order,
        "keys": {"step": STEP_KEY, "batch": BATCH_KEY, "alive": ALIVE_KEY, "waiting": WAITING_KEY, "setup": SETUP_KEY},
        "services": {
            name: {
                "inputs": [{"port": i.port, "delay": i.delay} for i in service.inputs],
                "ports": [{"name": p.name, "period": p.period, "columns": columns(p.like)} for p in service.ports],
            }
            for name, service in setup.services.items()
        },
        "setup": to_json(setup),
    }
