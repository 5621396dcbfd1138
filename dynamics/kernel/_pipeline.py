"""How kernels are compiled: what is compiled for another kernel's sake is optimised, but gets no machine code.

Of every function, however small, numba makes machine code and two wrappers, for calls from Python and from C. A kernel
calls hundreds that end up inlined in it, so that most of the compile time went there. Here such a function is an
`InnerLibrary`: optimised LLVM code, linked into its caller as numba links any. The outermost kernel's own code is the
same with or without (docs/benchmarks.md, "Compile time").
"""

import threading
from typing import Any

import numba
from llvmlite import binding
from numba.core import sigutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, DefaultPassBuilder, PassManager
from numba.core.compiler_machinery import register_pass
from numba.core.lowering import Lower
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering


class _Depth(threading.local):
    """Of the compilations in this thread that wait for one another."""

    value = 0


_depth = _Depth()


def is_nested() -> bool:
    """Does a compilation in this thread wait for the next one?"""
    return _depth.value > 0


class InnerLibrary(JITCodeLibrary):
    """Optimised code to link into others, never emitted."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Name, kind and bitcode."""
        self._ensure_finalized()
        return self.name, "inner", self._get_module_for_linking().as_bitcode()

    @classmethod
    def restored(cls, codegen: Any, serialised: tuple[str, str, bytes]) -> "InnerLibrary":
        """The library of what `serialize_using_object_code` gave."""
        name, _, bitcode = serialised
        library = cls(codegen, name)
        library._final_module = library._shared_module = binding.parse_bitcode(bitcode)
        library._finalize_final_module()
        return library


def restored(target_context: Any, reduced: tuple) -> CompileResult:
    """The result of compiling an inner function, from what `CompileResult._reduce` gave of it."""
    serialised, fndesc, environment, signature, objectmode, lifted, annotation, reload_init, environments = reduced
    for reload in reload_init:
        reload()
    library = InnerLibrary.restored(target_context.codegen(), serialised)
    return CompileResult(
        typing_context=target_context.typing_context, target_context=target_context, library=library,
        environment=environment, entry_point=_refusal(target_context), fndesc=fndesc, type_annotation=annotation,
        signature=signature, objectmode=objectmode, lifted=lifted, typing_error=None, call_helper=None, metadata=None,
        reload_init=reload_init, referenced_envs=environments,
    )  # fmt: skip


@numba.njit
def _refuse() -> None:
    raise RuntimeError("compiled for other kernels only")


def _refusal(target_context: Any) -> Any:
    """A new object that stands where numba wants an entry from Python: by it the caller finds the inner function."""
    _refuse.compile(())
    result = _refuse.overloads[()]
    return target_context.get_executable(result.library, result.fndesc, result.environment)


class _Lower(Lower):
    """numba's, which would take every tuple apart to count references to arrays, also where it holds none."""

    def incref(self, typ: types.Type, val: Any) -> None:
        if self._is_counted(typ):
            super().incref(typ, val)

    def decref(self, typ: types.Type, val: Any) -> None:
        if self._is_counted(typ):
            super().decref(typ, val)

    def _is_counted(self, typ: types.Type) -> bool:
        return self.context.data_model_manager[typ].contains_nrt_meminfo()


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(NativeLowering):
    """To machine code with wrappers for Python and C."""

    _name = "kernel_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        """What writes the LLVM code."""
        return _Lower


@register_pass(mutates_CFG=True, analysis_only=False)
class InnerLowering(KernelLowering):
    """To an `InnerLibrary`, without wrappers."""

    _name = "inner_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower the function of `state`."""
        state.flags = state.flags.copy()
        state.flags.no_compile = state.flags.no_cpython_wrapper = state.flags.no_cfunc_wrapper = True
        state.library = InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        super().run_pass(state)
        entry, lowered = _refusal(state.targetctx), state["cr"]
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = lowered._replace(cfunc=entry)
        return True


class Pipeline(Compiler):
    """numba's pipeline, with the lowering passes of this module."""

    def define_pipelines(self) -> list[PassManager]:
        """The only one."""
        lowering = InnerLowering if _depth.value > 1 else KernelLowering
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes = [(lowering, text) if p is NativeLowering else (p, text) for p, text in pipeline.passes]
        pipeline.finalize()
        return [pipeline]

    def _compile_core(self) -> CompileResult:
        _depth.value += 1
        try:
            result = super()._compile_core()
        finally:
            _depth.value -= 1
        if not is_nested():  # those of the inner functions that it holds
            for environment in result._find_referenced_environments():
                result.library.codegen.set_env(environment.env_name, environment)
        return result


class KernelDispatcher(CPUDispatcher):
    """numba's dispatcher, which compiles a function again when Python calls what was compiled for kernels only."""

    def compile(self, sig: Any) -> Any:
        """Its entry from Python for a signature."""
        arguments, _ = sigutils.normalize_signature(sig)
        found = self.overloads.get(tuple(arguments))
        if found is not None and isinstance(found.library, InnerLibrary) and not is_nested():
            del self.overloads[tuple(arguments)]
        return super().compile(sig)

    def add_overload(self, cres: CompileResult) -> None:
        """Offer a version to kernels, and to Python if it is emitted."""
        if isinstance(cres.library, InnerLibrary):
            self.overloads[tuple(cres.signature.args)] = cres
        else:
            super().add_overload(cres)
