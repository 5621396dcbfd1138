"""LLVM code of kernels and of the functions inside them, kept as bitcode: a tenth of the memory of LLVM modules."""

import re
from typing import Any

from llvmlite import binding
from llvmlite.binding.newpassmanagers import NewPassManager
from numba.core import config
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import lookup_environment

from lapwing.kernels.compiler.call_convention import has_unique_name, unique

_ALLOCATORS = ("NRT_Allocate", "NRT_MemInfo_alloc", "NRT_MemInfo_new", "NRT_MemInfo_varsize_alloc")
_COUNTERS = ("NRT_incref", "NRT_decref")
_SHARED = (binding.Linkage.linkonce_odr, binding.Linkage.weak_odr)
_SUFFIX = ".no_refcount"
# Replace numba's functions and vanish when inlined. Weak, so that definitions linked later take precedence.
_EMPTY_COUNTERS = "".join(f"define weak_odr void @{name}(ptr %0) alwaysinline {{ ret void }}\n" for name in _COUNTERS)


def _run(manager: NewPassManager, *arguments: Any) -> None:
    """Run a pass manager and free it; llvmlite 0.50 does not, because a base class hides its method."""
    manager.run(*arguments)
    NewPassManager._dispose(manager)
    manager.detach()


def _allocates(module: Any) -> bool:
    return any(function.name.startswith(_ALLOCATORS) for function in module.functions)


def _remove_refcounts(module: Any) -> None:
    """Remove reference counting from a module.

    Shared inner functions are renamed: LLVM uses the first loaded definition of a name for all modules, also for those
    that rely on counting.
    """
    module.link_in(binding.parse_assembly(_EMPTY_COUNTERS))
    for function in module.functions:
        if not function.is_declaration and function.linkage in _SHARED and not function.name.endswith(_SUFFIX):
            function.name, function.linkage = function.name + _SUFFIX, "linkonce_odr"


class KernelLibrary(JITCodeLibrary):
    """Code of a kernel. The `noinline` functions that it reaches are linked after all other code is optimised.

    Attributes:
        vectorise_loops: leave loops unchanged until the functions that they call are inlined.
        no_refcount: count no references, unless the code allocates arrays.
    """

    vectorise_loops = no_refcount = False

    def __init__(self, codegen: Any, name: str):
        super().__init__(codegen, name)
        self._inner: dict[InnerLibrary, None] = {}  # libraries to link before optimisation
        self._noinline: dict[str, InnerLibrary] = {}  # by symbol of the function
        self._bitcode = b""  # after finalisation

    def add_linking_library(self, library: Any) -> None:
        """Link a library, or declare its function if that is `noinline`, so that LLVM optimises it once."""
        library._ensure_finalized()
        self._noinline |= getattr(library, "_noinline", {})
        self._dynamic_globals += library._dynamic_globals  # code with addresses of this process is not stored
        if not isinstance(library, InnerLibrary):
            super().add_linking_library(library)
        elif library.noinline:
            self._noinline[library.noinline] = library
        else:
            self._inner[library] = None

    def finalize(self) -> None:
        """Link, optimise, and emit machine code."""
        for library in self._inner:
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking())
        self._inner.clear()
        if self.no_refcount:
            noinline = [library._get_module_for_linking() for library in self._noinline.values()]
            self.no_refcount = not any(map(_allocates, (self._final_module, *noinline)))
        super().finalize()

    def _declare_variants(self) -> None:
        """Declare the variants for vectors of the functions that are called, so that loops are vectorised with them."""
        lines, names = [], []
        for library in self._noinline.values():
            for function in library._get_module_for_linking().functions:
                if PureLibrary.VARIANT.search(function.name):
                    returns, _, arguments = str(function.global_value_type).rpartition(" (")
                    lines.append(f'declare {returns} @"{function.name}"({arguments}')
                    names.append(f'ptr @"{function.name}"')
        if names:  # otherwise removed as unused before loops are vectorised
            used = f"appending global [{len(names)} x ptr] [{', '.join(names)}]"
            text = "\n".join((*lines, f'@llvm.compiler.used = {used}, section "llvm.metadata"'))
            self._final_module.link_in(binding.parse_assembly(text))

    def _optimize_final_module(self) -> None:
        if self.vectorise_loops:
            self._declare_variants()
        if self.no_refcount:
            _remove_refcounts(self._final_module)
        # numba runs a cheap pass manager before, for kernels that count more references than ours
        manager, builder = self._codegen._module_pass_manager()
        _run(manager, self._final_module, builder)

    def _make_names_unique(self) -> None:
        """Rename the functions of numba that are not inlined. See `call_convention.unique`."""
        for function in self._final_module.functions:
            is_numba = function.name.startswith("_ZN") and not has_unique_name(function.name)
            if is_numba and not function.is_declaration and function.linkage in _SHARED:
                function.name = unique(function.name)

    def _optimize_functions(self, module: Any) -> None:
        """Run the function passes. Numba also creates a pass manager for declarations, which takes most of the time."""
        module.data_layout = self._codegen._data_layout
        for function in module.functions:
            if not function.is_declaration:
                manager, builder = self._function_passes()
                _run(manager, function, builder)

    def _function_passes(self) -> Any:
        """Return a pass manager and its builder: of level 1, since the module passes follow."""
        if not self.vectorise_loops:
            return self._codegen._function_pass_manager(opt=1)
        options = binding.create_pipeline_tuning_options(config.OPT)  # type: ignore[attr-defined]
        options.loop_unrolling = options.loop_vectorization = options.slp_vectorization = False
        builder = binding.create_pass_builder(self._codegen._tm, options)
        manager = builder.getFunctionPassManager()
        manager.add_refprune_pass()
        return manager, builder

    def _finalize_final_module(self) -> None:
        for library in reversed(self._noinline.values()):  # callers first: only called functions are linked
            self._final_module.link_in(library._get_module_for_linking())
        if self.no_refcount and self._noinline:
            _remove_refcounts(self._final_module)
            inliner = binding.create_new_module_pass_manager()
            inliner.add_always_inliner_pass()
            _run(inliner, self._final_module, self._codegen._pass_builder())
        self._make_names_unique()
        super()._finalize_final_module()
        emitted = self._final_module
        self._bitcode = super()._get_module_for_linking().as_bitcode()
        self._codegen._engine._ee.remove_module(emitted)  # keeps its machine code
        self._forget_modules()

    def _get_module_for_linking(self) -> Any:
        """Return a new module for each library that links it."""
        self._ensure_finalized()
        return binding.parse_bitcode(self._bitcode)

    def _forget_modules(self) -> None:
        self._final_module, self._shared_module, self._disable_inspection = binding.parse_assembly(""), None, True


class InnerLibrary(KernelLibrary):
    """Optimised code to link into other libraries, never emitted as machine code.

    Attributes:
        noinline: symbol of its function if that is `noinline`, else "".
        forwards: its function only calls another, which is optimised, and is inlined itself.
    """

    noinline, forwards = "", False

    def __init__(self, codegen: Any, name: str):
        super().__init__(codegen, name)
        self._environments: frozenset[str] = frozenset()

    def _optimize_final_module(self) -> None:
        if not self.forwards:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._make_names_unique()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.external:
                function.linkage = "linkonce_odr"  # one of its copies in the callers is used
        names = {value.name for value in self._final_module.global_variables}
        self._environments = frozenset(name for name in names if name.startswith("_ZN08NumbaEnv"))
        self._bitcode = self._final_module.as_bitcode()
        self._finalized = True
        self._forget_modules()

    def environments(self) -> tuple:
        """Return the numba environments of its functions and of the `noinline` functions that they reach."""
        names = self._environments.union(*(library._environments for library in self._noinline.values()))
        environments = (lookup_environment(name) for name in sorted(names))
        return tuple(environment for environment in environments if environment is not None and environment.can_cache())

    def serialize_using_object_code(self) -> tuple:
        """Return (name, `noinline` symbol, bitcode, environments) of this library and of the ones that it reaches."""
        self._ensure_finalized()
        return tuple((x.name, x.noinline, x._bitcode, x._environments) for x in (self, *self._noinline.values()))

    @classmethod
    def restore(cls, codegen: Any, serialised: tuple) -> "InnerLibrary":
        """Return the library from the result of `serialize_using_object_code`."""
        libraries = []
        for name, noinline, bitcode, environments in serialised:
            library = cls(codegen, name)
            library.noinline, library._bitcode, library._environments = noinline, bitcode, environments
            library._finalized = True
            libraries.append(library)
        libraries[0]._noinline = {library.noinline: library for library in libraries[1:]}
        return libraries[0]


class PureLibrary(InnerLibrary):
    """Code of a pure function of numbers and of its variants for vectors, whose loops are vectorised but not unrolled.

    Attributes:
        VARIANT: end of the names of variants.
    """

    vectorise_loops = True
    VARIANT = re.compile(r"\.v\d+$")

    def _optimize_final_module(self) -> None:
        options = binding.create_pipeline_tuning_options(config.OPT)  # type: ignore[attr-defined]
        options.loop_unrolling, options.loop_vectorization, options.slp_vectorization = False, True, False
        builder = binding.create_pass_builder(self._codegen._tm, options)
        _run(builder.getModulePassManager(), self._final_module, builder)
