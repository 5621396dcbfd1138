"""What compiling leaves behind in memory."""

import gc
from collections import Counter

from llvmlite.binding import ffi

from lapwing.kernels import kernel


def test_every_pass_manager_is_freed(monkeypatch):
    library, called = ffi.lib, Counter()

    class Counted:
        def __getattr__(self, name):
            called[name] += 1
            return getattr(library, name)

    monkeypatch.setattr(ffi, "lib", Counted())

    @kernel
    def twice(x):
        return 2.0 * x

    twice._cache.disable()  # it is to be compiled
    assert twice(3.0) == 6.0
    gc.collect()
    assert called["LLVMPY_buildFunctionSimplificationPipeline"] == called["LLVMPY_DisposeNewFunctionPassManger"] > 0
    assert called["LLVMPY_buildPerModuleDefaultPipeline"] == called["LLVMPY_DisposeNewModulePassManger"] > 0


def test_numbas_own_form_of_a_function_is_not_kept():
    @kernel
    def twice(x):
        return 2.0 * x

    @kernel
    def outer(x):
        return twice(x) + 1.0

    for each in (twice, outer):
        each._cache.disable()
    assert outer(3.0) == 7.0
    for each in (twice, outer):
        assert [result.type_annotation for result in each.overloads.values()] == [""]
