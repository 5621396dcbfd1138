"""Layout of the step packets of a run, for programs in other languages: the columns of each port by name."""

from typing import Any

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import to_json
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, BATCH_KEY, CONFIG_KEY, STEP_KEY, WAITING_KEY


def columns(example: Any, name: str = "") -> list[str]:
    """Return the columns of a port in their order: "position_world.0", "armed"."""
    if not isinstance(example, tuple):
        return [name]
    fields = getattr(example, "_fields", range(len(example)))
    parts = zip(fields, example, strict=True)
    return [column for field, part in parts for column in columns(part, f"{name}.{field}" if name else str(field))]


def layout(config: RunConfig) -> dict[str, Any]:
    """Return ports, periods and columns of all services as a tree for JSON.

    Returns:
        "rate" [Hz], "interval_ns", "last_tick", "order" (of the services within a tick), "keys" (the first parts of
        their keys, by purpose), "services" (by name: "inputs", each with "port" and "delay" [ticks], and "ports" in the
        order of a step packet, each with "name", "period" [ticks] and "columns"), and "config", the text of the run
        configuration.
    """
    return {
        "rate": config.rate,
        "interval_ns": config.interval_ns,
        "last_tick": config.last_tick,
        "order": config.order,
        "keys": {
            "step": STEP_KEY,
            "batch": BATCH_KEY,
            "alive": ALIVE_KEY,
            "waiting": WAITING_KEY,
            "config": CONFIG_KEY,
        },
        "services": {
            name: {
                "inputs": [{"port": i.port, "delay": i.delay} for i in service.inputs],
                "ports": [{"name": p.name, "period": p.period, "columns": columns(p.example)} for p in service.ports],
            }
            for name, service in config.services.items()
        },
        "config": to_json(config),
    }
