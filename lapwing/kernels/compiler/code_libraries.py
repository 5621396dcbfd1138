"""The code of a compiled function, as LLVM has it: of kernels, and of the functions inside them.

LLVM's form of a function takes some ten times the memory of its bitcode, so libraries keep the latter.
"""

from typing import Any

from llvmlite import binding
from llvmlite.binding.newpassmanagers import FunctionPassManager, ModulePassManager, NewPassManager
from numba.core import config
from numba.core.codegen import JITCodeLibrary
from numba.core.environment import lookup_environment

# llvmlite 0.50 frees no pass manager: what would stands behind another base class's method, which does nothing.
FunctionPassManager._dispose = ModulePassManager._dispose = NewPassManager._dispose


_ALLOCATES = ("NRT_Allocate", "NRT_MemInfo_alloc", "NRT_MemInfo_new", "NRT_MemInfo_varsize_alloc")
_COUNTING = ("NRT_incref", "NRT_decref")
_SHARED = (binding.Linkage.linkonce_odr, binding.Linkage.weak_odr)
_UNCOUNTED = ".uncounted"
# In place of numba's: inlined, and gone. Weak, since what is linked later must stand before what is there.
_NOTHING = "".join(f"define weak_odr void @{name}(ptr %0) alwaysinline {{ ret void }}\n" for name in _COUNTING)


def _allocates(module: Any) -> bool:
    return any(function.name.startswith(_ALLOCATES) for function in module.functions)


def _without_counting(module: Any) -> None:
    """Let the code count no references, once functions are inlined.

    Its inner functions get names of their own: of those of one name in several modules, whatever their linkage, the
    first that is loaded counts for all, also for who relies on its counting.
    """
    module.link_in(binding.parse_assembly(_NOTHING))
    for function in module.functions:
        if not function.is_declaration and function.linkage in _SHARED and not function.name.endswith(_UNCOUNTED):
            function.name, function.linkage = function.name + _UNCOUNTED, "linkonce_odr"


class KernelLibrary(JITCodeLibrary):
    """Code of a kernel, to which the functions apart that it reaches are linked only when all else is optimised.

    Attributes:
        vectorises: whether its loops are left as they are until what they call is inlined.
        uncounted: whether its code is to count no references, unless it makes arrays.
    """

    vectorises = uncounted = False

    def __init__(self, codegen: Any, name: str):
        super().__init__(codegen, name)
        self._inner: dict[InnerLibrary, None] = {}  # to be linked before this is optimised
        self._apart: dict[str, InnerLibrary] = {}  # by the symbol of the function
        self._bitcode = b""  # once it is finalized

    def add_linking_library(self, library: Any) -> None:
        """Link a library, or declare its function if that is apart: LLVM would optimise it again in every caller."""
        library._ensure_finalized()
        self._apart |= getattr(library, "_apart", {})
        if not isinstance(library, InnerLibrary):
            super().add_linking_library(library)
        elif library.apart:
            self._apart[library.apart] = library
        else:
            self._inner[library] = None

    def finalize(self) -> None:
        """Link, optimise, and emit what is to be emitted."""
        for library in self._inner:
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking())
        self._inner.clear()
        if self.uncounted:
            apart = [library._get_module_for_linking() for library in self._apart.values()]
            self.uncounted = not any(map(_allocates, (self._final_module, *apart)))
        super().finalize()

    def _optimize_final_module(self) -> None:
        if self.uncounted:
            _without_counting(self._final_module)
        super()._optimize_final_module()

    def _optimize_functions(self, module: Any) -> None:
        """As numba does, which makes a pass manager for each function that is declared only, too: most of its time."""
        module.data_layout = self._codegen._data_layout
        for function in module.functions:
            if not function.is_declaration:
                manager, builder = self._function_passes()
                manager.run(function, builder)

    def _function_passes(self) -> Any:
        """A pass manager and its builder."""
        if not self.vectorises:
            return self._codegen._function_pass_manager()
        options = binding.create_pipeline_tuning_options(config.OPT)  # type: ignore[attr-defined]
        options.loop_unrolling = options.loop_vectorization = options.slp_vectorization = False
        builder = binding.create_pass_builder(self._codegen._tm, options)
        manager = builder.getFunctionPassManager()
        manager.add_refprune_pass()
        return manager, builder

    def _finalize_final_module(self) -> None:
        for library in reversed(self._apart.values()):  # callers first: of a module only what is called is linked
            self._final_module.link_in(library._get_module_for_linking())
        if self.uncounted and self._apart:
            _without_counting(self._final_module)
            inliner = binding.create_new_module_pass_manager()
            inliner.add_always_inliner_pass()
            inliner.run(self._final_module, self._codegen._function_pass_manager()[1])
        super()._finalize_final_module()
        emitted = self._final_module
        self._bitcode = super()._get_module_for_linking().as_bitcode()
        self._codegen._engine._ee.remove_module(emitted)  # its machine code stays
        self._forget_modules()

    def _get_module_for_linking(self) -> Any:
        """A module of its own for each who links it."""
        self._ensure_finalized()
        return binding.parse_bitcode(self._bitcode)

    def _forget_modules(self) -> None:
        self._final_module, self._shared_module, self._disable_inspection = binding.parse_assembly(""), None, True


class InnerLibrary(KernelLibrary):
    """Optimised code to link into others, never emitted.

    Attributes:
        apart: the symbol of its function if that is apart, else "".
        forwards: whether its function only calls another, which is optimised, and is inlined itself.
    """

    apart, forwards = "", False

    def __init__(self, codegen: Any, name: str):
        super().__init__(codegen, name)
        self._environments: frozenset[str] = frozenset()

    def _optimize_final_module(self) -> None:
        if not self.forwards:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.external:
                function.linkage = "linkonce_odr"  # of its copies in several callers one counts
        names = {value.name for value in self._final_module.global_variables}
        self._environments = frozenset(name for name in names if name.startswith("_ZN08NumbaEnv"))
        self._bitcode = self._final_module.as_bitcode()
        self._finalized = True
        self._forget_modules()

    def environments(self) -> tuple:
        """What its functions, and those apart that they reach, refer to in numba."""
        names = self._environments.union(*(library._environments for library in self._apart.values()))
        found = (lookup_environment(name) for name in sorted(names))
        return tuple(environment for environment in found if environment is not None and environment.can_cache())

    def serialize_using_object_code(self) -> tuple:
        """Name, symbol if apart, bitcode and environments; the same of the functions apart that it reaches."""
        self._ensure_finalized()
        return tuple((x.name, x.apart, x._bitcode, x._environments) for x in (self, *self._apart.values()))

    @classmethod
    def restored(cls, codegen: Any, serialised: tuple) -> "InnerLibrary":
        """The library of what `serialize_using_object_code` gave."""
        made = []
        for name, apart, bitcode, environments in serialised:
            library = cls(codegen, name)
            library.apart, library._bitcode, library._environments = apart, bitcode, environments
            library._finalized = True
            made.append(library)
        made[0]._apart = {library.apart: library for library in made[1:]}
        return made[0]
