"""Named inputs of effects: quantities that an external model, such as an FMU, computes in place of the effect's own.

An effect that can have them has a method `with_inputs(self)`. It returns the parameters of another class, declared by
`external`, with the fields `own` (the effect's parameters) and `inputs`: a NamedTuple of all named inputs, with units
in the comments of its fields, and NaN in each number. A number that stays NaN is computed by the effect itself.

The discrete state of such an effect is (its own, inputs). The plant stores new inputs once a communication step.
"""

from typing import Any

from lapwing.dynamics.effects._hooks import initial_discrete_state
from lapwing.kernels import always_inline, math
from lapwing.kernels.codegen import compile_source, generic, map_tuple

_CLASSES: set[type] = set()


def external(parameters: type) -> type:
    """Declare the parameter class of an effect with named inputs."""
    _CLASSES.add(parameters)
    return parameters


def has_inputs(parameters: type) -> bool:
    """Return True if the parameter class of an effect is declared by `external`."""
    return parameters in _CLASSES


def inputs_of(effects: tuple) -> list[Any]:
    """Return the prototypes of the named inputs, one of each effect that has them, in the order of the effects."""
    return [e.inputs for e in effects if type(e) in _CLASSES]


def initial_state(e: Any) -> tuple:
    """Return the discrete state of an effect with named inputs before its first sample."""
    return initial_discrete_state(e.own), e.inputs


@always_inline
def input_or(own, value):
    """Return the input `value`, or `own` where the external model computes none."""
    return own if math.isnan(value) else value


@always_inline
def _input_or(_, own, value):
    return input_or(own, value)


@always_inline
def all_given_or(own, values):
    """Return `input_or` of each entry of two tuples."""
    return map_tuple(_input_or, 0.0, own, values)


@generic(inline=True)
def with_inputs_stored(effects: Any, memory: Any, samples: Any) -> Any:
    """Return the discrete states with the samples of named inputs, one for each effect that has them."""
    members = [f"memory[{i}]" for i in range(len(effects.types))]
    places = [i for i, e in enumerate(effects.types) if e.instance_class in _CLASSES]
    for k, i in enumerate(places):
        members[i] = f"(memory[{i}][0], latest(samples[{k}], memory[{i}][1]))"
    result = f"({''.join(f'{member}, ' for member in members)})" if places else "memory"
    return compile_source("with_inputs_stored(effects, memory, samples)", {"latest": _latest}, f"return {result}")


@always_inline
def _latest(sample, former):
    return sample.value if sample.due else former
