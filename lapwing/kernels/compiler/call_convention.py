"""Calling convention between kernels: every argument and the result is one value (by-value aggregate).

numba passes a tuple as separate numbers: 400 instructions per call for a state of a hundred numbers, two thirds of the
code that LLVM receives. After inlining both conventions lead to equal code.
"""

# numba.core.types fills itself at import
# mypy: disable-error-code="attr-defined"

import itertools
import os
import re
import uuid
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

from llvmlite import ir as llvm
from numba.core import cgutils, ir, types
from numba.core.callconv import RETCODE_OK, CPUCallConv, excinfo_t
from numba.core.imputils import impl_ret_new_ref
from numba.core.lowering import Lower

WIDEST = '"prefer-vector-width"="512"'  # by default LLVM uses half of the vector registers of Intel processors
CACHE_LINE = 64  # [bytes] alignment of the stack, so that no vector there is in two cache lines
WHOLE = ".whole"  # suffix of the names of functions with this convention

_count = itertools.count()


@cache
def _process(pid: int) -> str:
    return uuid.uuid4().hex


def unique(name: str) -> str:
    """Return a name that no other function has, in any process.

    LLVM uses the first definition of a name in all modules that it links or a process loads, and these are compiled by
    several processes. numba's names hold the names of classes without their modules, and a number that counts the
    functions of one process.
    """
    return f"{name}.{_process(os.getpid())}.{next(_count)}"


def has_unique_name(symbol: str) -> bool:
    """Return True if `unique` made a name."""
    return re.search(r"\.[0-9a-f]{32}\.", symbol) is not None


class _Whole:
    """Arguments as values of their own types; types without data are omitted."""

    def __init__(self, context: Any, arguments: Sequence[types.Type]):
        self._kinds = [None if isinstance(t, types.Omitted) else context.get_value_type(t) for t in arguments]
        self.argument_types = tuple(kind for kind in self._kinds if kind is not None)

    def as_arguments(self, builder: Any, values: Sequence[Any]) -> tuple:
        """Return the values to pass."""
        pairs = zip(values, self._kinds, strict=True)
        return tuple(_convert(builder, value, kind) for value, kind in pairs if kind is not None)

    def from_arguments(self, builder: Any, passed: Sequence[Any]) -> list:
        """Return the values of the passed arguments."""
        left = iter(passed)
        return [() if kind is None else next(left) for kind in self._kinds]

    def assign_names(self, passed: Sequence[Any], names: Sequence[str]) -> None:
        """Assign names to the passed arguments, for readable LLVM code."""
        for value, name in zip(passed, names, strict=False):
            value.name = name


def _convert(builder: Any, value: Any, kind: Any) -> Any:
    """Return a value in its declared type: numba passes `*arguments` as a struct even where the type is an array."""
    if value.type == kind:
        return value
    array = llvm.Constant(kind, llvm.Undefined)
    for i in range(kind.count):
        array = builder.insert_value(array, builder.extract_value(value, i), i)
    return array


class ValueCallConv(CPUCallConv):
    """Numba's calling convention, except that a tuple is passed as one value."""

    def _get_arg_packer(self, argtypes: Sequence[types.Type]) -> _Whole:
        return _Whole(self.context, argtypes)

    def get_return_type(self, ty: types.Type) -> Any:
        """Return the type of the pointer to the result."""
        return self.context.get_value_type(ty).as_pointer()

    def declare(self, module: Any, fndesc: Any) -> Any:
        """Return the function of a descriptor in a module."""
        kind = self.get_function_type(fndesc.restype, fndesc.argtypes)
        function = cgutils.get_or_insert_function(module, kind, fndesc.mangled_name)
        self.decorate_function(function, fndesc.args, fndesc.argtypes, noalias=fndesc.noalias)
        if fndesc.inline:
            function.attributes.add("alwaysinline")
        return function

    def call(self, builder: Any, fndesc: Any, values: Sequence[Any]) -> Any:
        """Call the function of a descriptor and return its result; an error propagates to the caller of the caller."""
        function = self.declare(builder.module, fndesc)
        place = cgutils.alloca_once(builder, self.get_return_type(fndesc.restype).pointee)
        error = cgutils.alloca_once(builder, llvm.PointerType(excinfo_t), name="excinfo")
        packer = self._get_arg_packer(fndesc.argtypes)
        code = builder.call(function, [place, error, *packer.as_arguments(builder, values)])
        with cgutils.if_unlikely(builder, builder.icmp_signed("!=", code, RETCODE_OK)):
            self.return_status_propagate(builder, _Failed(code, builder.load(error)))
        return builder.load(place)


class _Failed(NamedTuple):
    """Status of a failed call: the part of numba's `Status` that is propagated."""

    code: Any
    excinfoptr: Any


def uses_value_call_conv(fndesc: Any) -> bool:
    """Return True if the function of a descriptor is called by `ValueCallConv`."""
    return fndesc.mangled_name.endswith(WHOLE)


def offer(context: Any, entry: Any, fndesc: Any, library: Any) -> None:
    """Let numba's code call an inner function, which it identifies by its Python entry point."""
    if not uses_value_call_conv(fndesc):
        context.insert_user_function(entry, fndesc, [library])
        return

    def call(context: Any, builder: Any, signature: Any, values: Sequence[Any]) -> Any:
        result = ValueCallConv(context).call(builder, fndesc, values)
        return impl_ret_new_ref(context, builder, fndesc.restype, result)

    call.libs = (library,)  # type: ignore[attr-defined]
    context._defns[entry].append(call, fndesc.argtypes)  # the last definition for equal arguments is used


@cache
def _holds_arrays(models: Any, kind: types.Type) -> bool:
    return models[kind].contains_nrt_meminfo()


class KernelLower(Lower):
    """Numba's lowering with unique names, without reference counting of tuples that hold no arrays."""

    def __init__(self, context: Any, library: Any, fndesc: Any, interp: Any, **more: Any):
        if not any(isinstance(t, types.RecursiveCall) for t in fndesc.typemap.values()):  # known by its name
            fndesc.mangled_name = unique(fndesc.mangled_name) + self._convention(fndesc, interp)
        super().__init__(context, library, fndesc, interp, **more)

    def _convention(self, fndesc: Any, interp: Any) -> str:
        """Return the end of the name, which stands for the calling convention."""
        return ""

    def setup_function(self, fndesc: Any) -> None:
        """Write the start of the function."""
        super().setup_function(fndesc)
        if self.library.vectorise_loops:
            set.add(self.function.attributes, WIDEST)  # which llvmlite rejects as unknown
            self.function.attributes.alignstack = CACHE_LINE

    def incref(self, typ: types.Type, val: Any) -> None:
        """Count a new reference if the type holds arrays."""
        if self._is_counted(typ):
            super().incref(typ, val)

    def decref(self, typ: types.Type, val: Any) -> None:
        """Release a reference if the type holds arrays."""
        if self._is_counted(typ):
            super().decref(typ, val)

    def _is_counted(self, typ: types.Type) -> bool:
        return _holds_arrays(self.context.data_model_manager, typ)


class InnerLower(KernelLower):
    """Lowering of an inner function, called by `ValueCallConv` unless it needs numba's own convention."""

    def _convention(self, fndesc: Any, interp: Any) -> str:
        """Return the end of the name, which stands for the calling convention."""
        return "" if isinstance(fndesc.restype, types.Optional) or interp.generator_info is not None else WHOLE

    @property
    def call_conv(self) -> CPUCallConv:
        """Convention of the function itself."""
        return ValueCallConv(self.context) if uses_value_call_conv(self.fndesc) else super().call_conv

    def setup_function(self, fndesc: Any) -> None:
        """Write the start of the function."""
        if not uses_value_call_conv(fndesc):
            super().setup_function(fndesc)
            return
        self.function = ValueCallConv(self.context).declare(self.module, fndesc)
        if hasattr(self.func_ir.func_id.func, "__noinline__"):
            self.function.attributes.add("noinline")
        self.entry_block = self.function.append_basic_block("entry")
        self.builder = llvm.IRBuilder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def lower_inst(self, inst: Any) -> None:
        """Write one instruction."""
        if isinstance(inst, ir.Return) and uses_value_call_conv(self.fndesc):
            self.call_conv.return_value(self.builder, self.loadvar(inst.value.name))
        else:
            super().lower_inst(inst)
