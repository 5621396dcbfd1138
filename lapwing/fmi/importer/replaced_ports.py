"""Blocks of other services that read the ports of FMUs in place of the ports that these replace."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from lapwing.cosim.diagram.compiled_block import Block
from lapwing.cosim.diagram.port_rows import RenamedPortRows
from lapwing.cosim.diagram.tick_schedule import InputPort


def rewire(parts: Sequence[Any], replaced: Mapping[str, str]) -> list[Any]:
    """Return the blocks of a service with other inputs.

    Args:
        parts: compiled and Python blocks.
        replaced: port to read in place of each port of another service.
    """
    return [
        replace(part, inputs=_renamed(part.inputs, replaced))
        if isinstance(part, Block)
        else _PythonBlock(part, replaced)
        for part in parts
    ]


def _renamed(inputs: Sequence[InputPort], replaced: Mapping[str, str]) -> tuple[InputPort, ...]:
    return tuple(i._replace(port=replaced.get(i.port, i.port)) for i in inputs)


class _PythonBlock:
    """Python block with replaced ports; it reads ports by name from the diagram."""

    def __init__(self, part: Any, replaced: Mapping[str, str]):
        self._part, self._replaced = part, replaced
        self.inputs = _renamed(getattr(part, "inputs", ()), replaced)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._part, name)

    def bind(self, diagram: Any) -> None:
        self._part.bind(_Diagram(diagram, self._replaced))


class _Diagram(RenamedPortRows):
    """View of a block diagram, or of a vehicle's part, with ports of FMUs under the names of the replaced ports."""

    def __init__(self, diagram: Any, replaced: Mapping[str, str]):
        super().__init__(diagram, lambda port: replaced.get(port, port))
        self._diagram = diagram

    def __getattr__(self, name: str) -> Any:
        return getattr(self._diagram, name)
