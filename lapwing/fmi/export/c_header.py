"""C header of an exported library, which C++ can include too."""

import re
from collections.abc import Sequence

from lapwing.fmi.export.exported_part import BoundaryPort, ExportedPart
from lapwing.fmi.export.variables import structured_name
from lapwing.fmi.field_units import field_unit
from lapwing.kernels.row_packing import row_width

_HEAD = """/* {title}: the {part} of scene {scene}. Written by `lapwing export-library`.
 *
 * An instance is one block of memory without references to other memory. Functions of different instances may run in
 * different threads. No function allocates except {name}_new. SI units; world frame east-north-up, body frame
 * forward-left-up; quaternions (w, x, y, z) from body to world. One tick takes {interval!r} s.
 */
#ifndef {guard}
#define {guard}

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {{
#endif

#define {upper}_INTERVAL {interval!r} /* [s] of a tick */
#define {upper}_LAST_TICK {last}

typedef struct {name} {name};

enum {{ {upper}_RUNNING, {upper}_FINISHED, {upper}_FAILED }}; /* results of {name}_advance */

{name} *{name}_new(void);            /* NULL without memory */
void {name}_free({name} *self);
size_t {name}_size(void);            /* [bytes] of an instance */
void {name}_reset({name} *self);     /* also initialises memory of the caller, aligned to 64 bytes */
int {name}_advance({name} *self);    /* computes the next tick; the first call computes tick 0 */
int64_t {name}_tick(const {name} *self); /* last computed; -1 before the first */
int64_t {name}_missed(const {name} *self); /* events to which the recorded flight manager did not react */
void {name}_save(const {name} *self, void *state);  /* {name}_size() bytes */
void {name}_load({name} *self, const void *state);

/* Parameters, start values and single columns by name, as in an FMU. They return 0 on success. */
int {name}_find(const char *variable); /* reference; -1 if unknown */
int {name}_get(const {name} *self, int reference, double *value);
int {name}_set({name} *self, int reference, double value);

/* for the functions below */
void {name}_write({name} *self, int input, const void *sample);
void {name}_read(const {name} *self, int output, void *sample);
"""
_FOOT = """
#ifdef __cplusplus
}
#endif

#endif
"""


def header(part: ExportedPart, name: str) -> str:
    """Return the text of the C header.

    Args:
        part: part to export.
        name: prefix of all names.
    """
    config = part.config
    text = _HEAD.format(
        title=config.title.replace("*/", "* /"), part=part.name, scene=config.scene, name=name, upper=name.upper(),
        guard=f"{name.upper()}_H", interval=config.interval, last=config.last_tick,
    )  # fmt: skip
    both = {p.port.name: p for p in (*part.inputs, *part.outputs)}
    for port in both.values():
        text += f"\ntypedef struct {{\n{_fields(port)}}} {name}_{identifier(port)};\n"
    for k, port in enumerate(part.inputs):
        of = "this tick" if port.lag else "the next tick"
        sample = f"{name}_{identifier(port)} *sample"
        text += (
            f"\n/* Set input {port.port.name}: the sample of {of}, held until the next call. */\n"
            f"static inline void {name}_set_{identifier(port)}({name} *self, const {sample}) {{\n"
            f"    {name}_write(self, {k}, sample);\n}}\n"
        )
    for k, port in enumerate(part.outputs):
        sample = f"{name}_{identifier(port)} *sample"
        text += (
            f"\n/* Get output {port.port.name}, {_period(port)}. */\n"
            f"static inline void {name}_get_{identifier(port)}(const {name} *self, {sample}) {{\n"
            f"    {name}_read(self, {k}, sample);\n}}\n"
        )
    return text + _FOOT


def identifier(port: BoundaryPort) -> str:
    """Return the name of a port as a C identifier: "left/truth" becomes "left_truth"."""
    return re.sub(r"\W", "_", structured_name(port.port.name))


def _period(port: BoundaryPort) -> str:
    n = port.port.period
    return "every tick" if n <= 1 else f"every {n} ticks"


def _fields(port: BoundaryPort) -> str:
    """Return the fields of a struct: doubles in the order of the columns."""
    example = port.port.example
    names: Sequence[str] = getattr(example, "_fields", tuple(f"value_{i}" for i in range(len(example))))
    lines = []
    for name, part in zip(names, example, strict=True):
        unit = field_unit(type(example), name)
        note = f" /* [{unit}] */" if unit else ""
        if isinstance(part, tuple) and hasattr(part, "_fields"):
            inner = "; ".join(f"double {each}{_extent(item)}" for each, item in zip(part._fields, part, strict=True))
            lines.append(f"    struct {{ {inner}; }} {name};{note}\n")
        elif isinstance(part, tuple) and not part:
            continue
        else:
            kind = " /* 0 or 1 */" if isinstance(part, bool) else " /* whole */" if isinstance(part, int) else note
            lines.append(f"    double {name}{_extent(part)};{kind}\n")
    return "".join(lines) or "    char nothing;\n"


def _extent(part: object) -> str:
    """Return the array bounds of nested tuples of equal length; a tree of another shape is one flat array."""
    if not isinstance(part, tuple):
        return ""
    inner = {_extent(item) for item in part}
    return f"[{len(part)}]{inner.pop()}" if len(inner) == 1 else f"[{row_width(part)}]"
