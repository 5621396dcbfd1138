"""C header and C++ wrapper of an exported library."""

import re
from collections.abc import Sequence

from lapwing.fmi.exported_part import BoundaryPort, ExportedPart
from lapwing.fmi.variables import structured_name
from lapwing.kernels.row_packing import row_width
from lapwing.services.common.field_units import field_unit

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
    setup = part.setup
    text = _HEAD.format(
        title=setup.title.replace("*/", "* /"), part=part.name, scene=setup.scene, name=name, upper=name.upper(),
        guard=f"{name.upper()}_H", interval=setup.interval, last=setup.last_tick,
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


def wrapper(part: ExportedPart, name: str) -> str:
    """Return the text of the C++ wrapper, a class with a method for each port."""
    ports = "".join(
        f"    /// Set input {p.port.name}; it is held until the next call.\n"
        f"    void set(const {name}_{identifier(p)} &sample) {{ {name}_set_{identifier(p)}(self_.get(), &sample); }}\n"
        for p in part.inputs
    )
    ports += "".join(
        f"    /// Return output {p.port.name}, {_period(p)}.\n"
        f"    {name}_{identifier(p)} {identifier(p)}() const {{\n"
        f"        {name}_{identifier(p)} sample;\n        {name}_get_{identifier(p)}(self_.get(), &sample);\n"
        f"        return sample;\n    }}\n"
        for p in part.outputs
    )
    cls = class_name(name)
    upper = name.upper()
    return f"""// C++ wrapper of {name}.h. Written by `lapwing export-library`.
#pragma once

#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "{name}.h"

/// An instance of the {part.name} of scene {part.setup.scene}. Movable, not copyable; see save() and load().
class {cls} {{
  public:
    static constexpr double interval = {upper}_INTERVAL;  ///< [s] of a tick

    {cls}() : self_({name}_new()) {{
        if (!self_) throw std::bad_alloc();
    }}

    /// Compute the next tick; the first call computes tick 0. Return false once the scene has ended.
    /// Throws std::runtime_error if the state is not finite.
    bool advance() {{
        const int result = {name}_advance(self_.get());
        if (result == {upper}_FAILED) throw std::runtime_error("{name}: the state is not finite");
        return result == {upper}_RUNNING;
    }}
    void reset() {{ {name}_reset(self_.get()); }}
    /// Return the last computed tick, -1 before the first.
    std::int64_t tick() const {{ return {name}_tick(self_.get()); }}
    double time() const {{ return static_cast<double>(tick()) * interval; }}  ///< [s]

    /// Return the state, to load it into any instance of this class.
    std::vector<unsigned char> save() const {{
        std::vector<unsigned char> state({name}_size());
        {name}_save(self_.get(), state.data());
        return state;
    }}
    /// Throws std::invalid_argument if the state has another size.
    void load(const std::vector<unsigned char> &state) {{
        if (state.size() != {name}_size()) throw std::invalid_argument("{name}: not a state of this part");
        {name}_load(self_.get(), state.data());
    }}

    /// Return a variable by its name. Throws std::out_of_range if there is none.
    double get(const std::string &variable) const {{
        double value;
        if ({name}_get(self_.get(), {name}_find(variable.c_str()), &value)) throw std::out_of_range(variable);
        return value;
    }}
    /// Set an input, a parameter, or before the first tick a start value. Throws std::out_of_range if that fails.
    void set(const std::string &variable, double value) {{
        if ({name}_set(self_.get(), {name}_find(variable.c_str()), value)) throw std::out_of_range(variable);
    }}

{ports}
  private:
    struct Deleter {{
        void operator()({name} *self) const {{ {name}_free(self); }}
    }};
    std::unique_ptr<{name}, Deleter> self_;
}};
"""


def class_name(name: str) -> str:
    """Return the name of the C++ class: "hover_plant" becomes "HoverPlant"."""
    return "".join(word.capitalize() for word in name.split("_"))


def identifier(port: BoundaryPort) -> str:
    """Return the name of a port as a C identifier: "left/truth" becomes "left_truth"."""
    return re.sub(r"\W", "_", structured_name(port.port.name))


def _period(port: BoundaryPort) -> str:
    n = port.port.period
    return "every tick" if n <= 1 else f"every {n} ticks"


def _fields(port: BoundaryPort) -> str:
    """Return the fields of a struct: doubles in the order of the columns."""
    like = port.port.like
    names: Sequence[str] = getattr(like, "_fields", tuple(f"value_{i}" for i in range(len(like))))
    lines = []
    for name, part in zip(names, like, strict=True):
        unit = field_unit(type(like), name)
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
