"""Compile pipeline: functions compiled for other kernels are optimised but get no machine code.

numba makes machine code and two wrappers, for calls from Python and C, of every function. A kernel calls hundreds that
end up inlined in it, which would take most of the compile time. Here such a function is an `InnerLibrary`: optimised
LLVM code linked into its caller, with arguments passed by value (`call_convention`). The machine code of the outermost
kernel is as fast with or without (docs/appendix/benchmark_history.md, "Compile time").
"""

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.core import ir, sigutils, types
from numba.core.compiler import Compiler, CompileResult, DefaultPassBuilder, PassManager
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering, NopythonRewrites

from lapwing.kernels.compiler.cache import KernelCache
from lapwing.kernels.compiler.call_convention import InnerLower, KernelLower, offer, uses_value_call_conv
from lapwing.kernels.compiler.code_libraries import InnerLibrary, KernelLibrary
from lapwing.kernels.compiler.file_locks import release_at_end


class _Depth(threading.local):
    """Depth of nested compilations in this thread."""

    value = 0


_depth = _Depth()


@contextmanager
def _nested_compilation() -> Iterator[None]:
    _depth.value += 1
    try:
        yield
    finally:
        _depth.value -= 1


@contextmanager
def _no_collection() -> Iterator[None]:
    """Disable the garbage collector: nearly all objects of a compilation are in use until it ends."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def is_nested() -> bool:
    """Return True if a compilation in this thread waits for the next one."""
    return _depth.value > 0


@numba.njit
def _refuse() -> None:
    raise RuntimeError("compiled for use by other kernels only")


def _refusal(target_context: Any) -> Any:
    """Return a new placeholder for the Python entry point, by which the caller finds the inner function."""
    _refuse.compile(())
    result = _refuse.overloads[()]
    return target_context.get_executable(result.library, result.fndesc, result.environment)


class PipelineCache(KernelCache):
    """Kernel cache that also stores inner functions: optimised LLVM code without an entry from Python."""

    def _is_inner(self, result: CompileResult | None = None) -> bool:
        return is_nested() if result is None else isinstance(result.library, InnerLibrary)

    def _reduce(self, result: CompileResult) -> tuple:
        parts = super()._reduce(result)
        return (*parts[:-1], result.library.environments()) if self._is_inner(result) else parts

    def _rebuild(self, target_context: Any, payload: tuple) -> CompileResult:
        if not is_nested():
            return super()._rebuild(target_context, payload)
        serialised, fndesc, environment, signature, objectmode, lifted, annotation, reload_init, environments = payload
        for reload in reload_init:
            reload()
        library = InnerLibrary.restore(target_context.codegen(), serialised)
        return CompileResult(
            typing_context=target_context.typing_context, target_context=target_context, library=library,
            environment=environment, entry_point=_refusal(target_context), fndesc=fndesc, type_annotation=annotation,
            signature=signature, objectmode=objectmode, lifted=lifted, typing_error=None, call_helper=None,
            metadata=None, reload_init=reload_init, referenced_envs=environments,
        )  # fmt: skip


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(NativeLowering):
    """Lowering to machine code with wrappers for Python and C."""

    _name = "kernel_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        """Class that writes the LLVM code."""
        return KernelLower

    def run_pass(self, state: Any) -> bool:
        """Lower the function of `state`."""
        if state.library is None:
            state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.vectorise_loops = hasattr(state.func_id.func, "__vectorise_loops__")
            state.library.no_refcount = hasattr(state.func_id.func, "__no_refcount__")
            state.library.enable_object_caching()
        return super().run_pass(state)


def _forwards(func_ir: Any) -> bool:
    """Return True if a function passes its arguments to another and returns its result.

    Functions with a kernel as argument do not qualify: optimisation must first remove its unused address.
    """
    if len(func_ir.blocks) != 1:
        return False
    (block,) = func_ir.blocks.values()
    values = [instruction.value for instruction in block.find_insts(ir.Assign)]
    operations = [value.op for value in values if isinstance(value, ir.Expr)]
    names = [value for value in values if isinstance(value, ir.Global | ir.FreeVar)]
    return operations.count("call") == 1 and set(operations) <= {"call", "cast"} and len(names) <= 1


@register_pass(mutates_CFG=True, analysis_only=False)
class InnerLowering(KernelLowering):
    """Lowering to an `InnerLibrary`, without wrappers."""

    _name = "inner_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        """Class that writes the LLVM code of a function that may use `ValueCallConv`."""
        return InnerLower

    def run_pass(self, state: Any) -> bool:
        """Lower the function of `state`."""
        state.flags = state.flags.copy()
        state.flags.no_compile = state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = True
        state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.forwards = state.flags.forceinline and _forwards(state.func_ir)
        super().run_pass(state)
        entry, lowered = _refusal(state.targetctx), state["cr"]
        if hasattr(state.func_id.func, "__noinline__") and uses_value_call_conv(lowered.fndesc):
            state.library.noinline = lowered.fndesc.mangled_name
        offer(state.targetctx, entry, lowered.fndesc, state.library)
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = lowered._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelRewrites(NopythonRewrites):
    """Numba's rewrites of typed code, limited to functions with array expressions or string indices."""

    _name = "kernel_rewrites"

    def run_pass(self, state: Any) -> bool:
        """Rewrite the function of `state` if it contains either."""
        if any(isinstance(kind, types.Array | types.misc.StringLiteral) for kind in state.typemap.values()):
            return super().run_pass(state)
        return False


class Pipeline(Compiler):
    """Numba's pipeline with the passes of this module."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the only pipeline."""
        ours = {NativeLowering: InnerLowering if _depth.value > 1 else KernelLowering, NopythonRewrites: KernelRewrites}
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes = [(ours.get(each, each), text) for each, text in pipeline.passes]
        pipeline.finalize()
        return [pipeline]

    def _compile_core(self) -> CompileResult:
        with _nested_compilation(), _no_collection():
            result = super()._compile_core()
        if not is_nested():  # environments of its inner functions
            for environment in result._find_referenced_environments():
                result.library.codegen.set_env(environment.env_name, environment)
        # numba's representation of the function for printing: most of the memory in Python, and slow to format
        return result._replace(type_annotation="")


def _widen(kind: types.Type) -> types.Type:
    """Return the plain number type of a constant's type."""
    return types.misc.unliteral(kind) if isinstance(kind, types.IntegerLiteral | types.BooleanLiteral) else kind


class KernelDispatcher(CPUDispatcher):
    """Numba's dispatcher, which recompiles a function when Python calls a version compiled for kernels only."""

    def __init__(self, *arguments: Any, **options: Any):
        super().__init__(*arguments, pipeline_class=Pipeline, **options)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile one version for all integers and booleans, constant or not.

        numba would compile one for each constant. LLVM substitutes constants where it inlines the function.
        """
        one, named = [_widen(kind) for kind in args], {name: _widen(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(one), named)

    def compile(self, sig: Any) -> Any:
        """Return the Python entry point for a signature.

        Numba's method also measures the time of every LLVM call, which takes a twentieth of the compile time.
        """
        arguments, returns = sigutils.normalize_signature(sig)
        with release_at_end(), global_compiler_lock, self._compiling_counter:
            result = self.overloads.get(tuple(arguments))
            if result is not None and (is_nested() or not isinstance(result.library, InnerLibrary)):
                return result.entry_point
            if (result := self._cache.load_overload(sig, self.targetctx)) is not None:
                self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
                self.add_overload(result)
            else:
                result = self._compiler.compile(arguments, returns)
                self.add_overload(result)
                self._cache.save_overload(sig, result)
            return result.entry_point

    def add_overload(self, cres: CompileResult) -> None:
        """Register a version for kernels, and for Python if it has machine code."""
        if isinstance(cres.library, InnerLibrary):
            self.overloads[tuple(cres.signature.args)] = cres
            offer(self.targetctx, cres.entry_point, cres.fndesc, cres.library)  # also versions loaded from disk
        else:
            super().add_overload(cres)
