"""Tables of an exported part as a C header, which `native/runtime.c` includes."""

from collections.abc import Iterable, Sequence

from lapwing.fmi import variables as kinds
from lapwing.fmi.exported_part import BoundaryPort, ExportedPart
from lapwing.fmi.variables import Variable
from lapwing.kernels.row_packing import pack_row, row_width

_PLACES = {kinds.INPUT: "INPUT", kinds.OUTPUT: "OUTPUT", kinds.PARAMETER: "NUMBER", kinds.STATE: "NUMBER"}
_TYPES = {kinds.REAL: "REAL", kinds.INTEGER: "INTEGER", kinds.BOOLEAN: "BOOLEAN"}
CONTACT = ".ground_contact"  # suffix of outputs whose change is an event


def tables(
    part: ExportedPart, symbols: Sequence[str | None], variables: Sequence[Variable], image: str, arrays: int
) -> str:
    """Return the text of tables.h.

    Args:
        part: part to export.
        symbols: function of each block; None for a Python block.
        variables: variables in the order of their references from 1.
        image: symbol of the image.
        arrays: size of the arrays that blocks create in a step [bytes].
    """
    actions, writes, written = _actions(part)
    staged = [float(x) for port in part.inputs for x in pack_row(port.port.like)]
    blocks = [
        f"{{{symbol or 'NULL'}, {part.image.cells[_rank(part, k)] if block.bound else 0}, {block.every},"
        f" {block.vehicle}, {block.until}, {block.following}}}"
        for k, (block, symbol) in enumerate(zip(part.blocks, symbols, strict=True))
    ]
    contacts = [k for k, each in enumerate(variables, 1) if each.name.endswith(CONTACT)]
    sizes = {
        "IMAGE_SIZE": len(part.image.data),
        "RELOCATIONS": len(part.image.relocations),
        "BLOCKS": len(blocks) - part.replacements,
        "VEHICLES": 1 + max(block.vehicle for block in part.blocks),
        "INPUTS": len(part.inputs),
        "STAGED": len(staged),
        "ACTIONS": len(actions),
        "VARIABLES": len(variables) + 1,
        "EVENTS": len(contacts),
        "FAILURES": len(part.events),
        "ARRAYS": arrays,
        "PART_IMAGE": image,
        "PART_INTERVAL": f"(1.0 / {part.setup.rate})",
    }
    return "\n".join(
        [
            *(f"#define {name} {value}" for name, value in sizes.items()),
            f"extern const unsigned char {image}[];",
            *(f"extern step_function {symbol};" for symbol in dict.fromkeys(symbols) if symbol),
            _table("relocation", "part_relocations", (f"{{{at}, {to}}}" for at, to in part.image.relocations)),
            _table("block", "part_blocks", blocks),
            _table("port", "part_inputs", _ports(part, part.inputs)),
            _table("port", "part_outputs", _ports(part, part.outputs)),
            _table("double", "part_start", (_number(x) for x in staged)),
            _table("action", "part_actions", actions),
            _table("write_of", "part_writes", writes),
            _table("unsigned char", "part_written", (str(byte) for byte in written)),
            _table("variable", "part_variables", ['{"time", TIME, REAL, 0, 0, 0}', *map(_variable, variables)]),
            _table("uint32_t", "part_events", map(str, contacts)),
            _table("int64_t", "part_failures", map(str, part.events)),
            "",
        ]
    )


def _rank(part: ExportedPart, k: int) -> int:
    """Return the number of compiled blocks before block k."""
    return sum(block.bound is not None for block in part.blocks[:k])


def _table(kind: str, name: str, rows: Iterable[str]) -> str:
    texts = list(rows)
    return f"static const {kind} {name}[] = {{{', '.join(texts) or '0'}}};"


def _ports(part: ExportedPart, ports: Sequence[BoundaryPort]) -> list[str]:
    result, staged = [], 0
    for p in ports:
        width = row_width(p.port.like)
        result.append(f"{{{part.image.rows[p.ring]}, {p.depth}, {width}, {p.port.period}, {p.lag}, {staged}}}")
        staged += width
    return result


def _actions(part: ExportedPart) -> tuple[list[str], list[str], bytes]:
    """Return the rows of the tables of actions and writes, and the bytes written."""
    order = {block.part.name: k for k, block in enumerate(part.blocks)}
    actions: list[str] = []
    writes: list[str] = []
    written = bytearray()
    for a in sorted(part.actions, key=lambda a: (a.tick, order[a.block])):
        actions.append(f"{{{a.tick}, {order[a.block]}, {len(writes)}, {len(a.writes)}}}")
        for offset, data in a.writes:
            writes.append(f"{{{offset}, {len(written)}, {len(data)}}}")
            written += data
    return actions, writes, bytes(written)


def _variable(v: Variable) -> str:
    tunable = int(v.causality == kinds.PARAMETER)
    return f'{{"{v.name}", {_PLACES[v.causality]}, {_TYPES[v.type]}, {tunable}, {v.port}, {v.offset}}}'


def _number(x: float) -> str:
    return "(0.0 / 0.0)" if x != x else f"({x!r})".replace("inf", "1.0 / 0.0")
