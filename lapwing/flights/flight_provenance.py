"""Provenance of a flight: run configuration and log metadata."""

import json
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

from lapwing.cosim.config import provenance
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.config.serialise import from_json
from lapwing.cosim.diagram.multi_vehicle import member


def solver_and_exchange(metadata: Mapping[str, str]) -> dict[str, str]:
    """Return the texts of "solver" and "exchange" of a log; "" if the log has none."""
    solver = "{solver_integrator}, step {solver_step} s" if "solver_integrator" in metadata else ""
    exchange = f"{metadata['exchange_rate']} Hz, {metadata.get('coupling', '')}" if "exchange_rate" in metadata else ""
    return {"solver": solver.format_map(metadata), "exchange": exchange}


class Origin:
    """Origin of a flight: a log, or a run configuration simulated in memory.

    Attributes:
        source: the log's path or the scene's name, for messages to the user.
        vehicle: name of the vehicle.
        recorded: True for a log.
    """

    def __init__(
        self,
        source: str,
        vehicle: str,
        config: RunConfig | None,
        metadata: Mapping[str, str],
        attachments: Mapping[str, bytes],
    ):
        self.source, self.vehicle, self.recorded = source, vehicle, config is None
        self._config, self._metadata, self._attachments = config, metadata, attachments

    @classmethod
    def of_log(cls, source: str, vehicle: str, metadata: Mapping[str, str], attachments: Mapping[str, bytes]) -> Self:
        """Return the origin of a recorded flight."""
        return cls(source, vehicle, None, dict(metadata), dict(attachments))

    @classmethod
    def of_config(cls, config: RunConfig) -> Self:
        """Return the origin of a flight in memory."""
        return cls(config.scene, config.vehicle, config, {}, {})

    @cached_property
    def config(self) -> RunConfig:
        """Run configuration of the flight.

        Raises:
            ValueError: the log has no run configuration, or one that this version cannot read.
        """
        if self._config is not None:
            return self._config
        if provenance.CONFIG_FILE not in self._attachments:
            raise ValueError(f"{self.source}: has no attachment {provenance.CONFIG_FILE}")
        try:
            return member(from_json(self._attachments[provenance.CONFIG_FILE].decode()), self.vehicle)
        except ValueError as fault:
            raise self._unreadable(fault) from None

    @cached_property
    def scene(self) -> dict[str, Any]:
        """Tables of the scene, including those of its files; empty if the log has none.

        Raises:
            ValueError: they cannot be read.
        """
        if self._config is not None:
            return self._config.resolved
        try:  # only the tables: they stay readable when classes of the run configuration change
            tree = json.loads(self._attachments.get(provenance.CONFIG_FILE, b"{}")).get("resolved", {})
            result: dict[str, Any] = from_json(json.dumps(tree))
        except ValueError as fault:
            raise self._unreadable(fault) from None
        if not isinstance(result.get("vehicle"), list):
            return result
        own: dict[str, Any] = next(
            (entry for entry in result["vehicle"] if entry["vehicle"]["name"] == self.vehicle), {}
        )
        return {**result, **own}

    @cached_property
    def metadata(self) -> dict[str, str]:
        """Metadata as in a log: scene, seed, mode, version, digest and more."""
        return provenance.metadata(self._config, "memory") if self._config is not None else dict(self._metadata)

    def _unreadable(self, fault: ValueError) -> ValueError:
        return ValueError(f"{self.source}: its attachment {provenance.CONFIG_FILE} cannot be read: {fault}")
