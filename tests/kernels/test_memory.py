"""Memory that remains after compilation."""

from collections import Counter

from llvmlite.binding import ffi
from llvmlite.binding.newpassmanagers import FunctionPassManager, ModulePassManager

from lapwing.kernels import kernel


def _compile_first_kernel():
    """Compile the functions that numba compiles before the first kernel of a process."""

    @kernel
    def same(x):
        return x

    same._cache.disable()
    same(1.0)


def test_pass_managers_are_freed(monkeypatch):
    _compile_first_kernel()
    library, called = ffi.lib, Counter()

    class Counted:
        def __getattr__(self, name):
            called[name] += 1
            return getattr(library, name)

    monkeypatch.setattr(ffi, "lib", Counted())

    @kernel
    def twice(x):
        return 2.0 * x

    twice._cache.disable()
    assert twice(3.0) == 6.0
    assert called["LLVMPY_buildFunctionSimplificationPipeline"] == called["LLVMPY_DisposeNewFunctionPassManger"] > 0
    assert called["LLVMPY_buildPerModuleDefaultPipeline"] == called["LLVMPY_DisposeNewModulePassManger"] > 0


def test_llvmlite_classes_are_not_patched():
    for manager in (FunctionPassManager, ModulePassManager):
        assert "_dispose" not in vars(manager)


def test_type_annotations_are_dropped_after_compilation():
    @kernel
    def twice(x):
        return 2.0 * x

    @kernel
    def outer(x):
        return twice(x) + 1.0

    for function in (twice, outer):
        function._cache.disable()
    assert outer(3.0) == 7.0
    for function in (twice, outer):
        assert [result.type_annotation for result in function.overloads.values()] == [""]
