"""Diagrams of a few blocks, without a scene."""

from lapwing.cosim.config.run_config import RunConfig, ServiceConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service

NAME = "test"


def config_of(ports=(), last=10_000):
    """Return the configuration of a run with one service and these ports."""
    return RunConfig(
        NAME, "", 1, last, 100, 10_000_000, "gauss_seidel", "drone1", {NAME: ServiceConfig(None, (), ports)}, {}, {}
    )


def graph_of(*parts, ports=(), encoders=(), kept_ticks=8):
    """Return the diagram of these blocks; `ports` are their ports of other services."""
    return BlockDiagram(config_of(ports), [Service(NAME, list(parts), list(encoders))], kept_ticks)
