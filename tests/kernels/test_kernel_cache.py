"""Kernel cache: hits, staleness, damaged entries, isolation."""

import os
import shutil
import signal
import stat
import subprocess
import time

import pytest

from tests.combinations import rest_nightly

pytestmark = pytest.mark.long

OUTER = "from plant.outer import outer; values['outer'] = outer(3.0)"
TOTAL = "import plant.law; from plant.table import total; values['total'] = total(plant.law.Spring(3.0))"
PRODUCT = "from plant.factory import times; values['product'] = [times(2.0)(1.0), times(5.0)(1.0)]"
ALL = f"{OUTER}\n{TOTAL}\n{PRODUCT}"
VALUES = {"outer": 7.0, "total": 30.0, "product": [4.0, 10.0]}


def files(package):
    """Return all files of the cache."""
    return sorted(path for path in package.cache.rglob("*") if path.is_file())


def test_second_process_compiles_no_kernel(package):
    first, second = package.run(ALL), package.run(ALL)
    assert first["values"] == second["values"] == VALUES
    assert first["compiled"] == len(first["compiling"]) > 0
    assert "plant.outer.outer" in first["compiling"]
    assert (second["compiled"], second["compiling"]) == (0, [])
    assert second["loaded"] > 0


def test_functions_with_equal_names_in_two_processes_stay_apart(package):
    """LLVM links by names, and numba's end with a number that each process counts from 1."""
    run = "from plant.factory import shifted; values['sums'] = [shifted(n)(1.0) for n in {}]"
    assert [package.run(run.format([n]))["values"]["sums"] for n in (2.0, 5.0)] == [[4.0], [7.0]]
    both = package.run(run.format([2.0, 5.0]))
    assert (both["values"]["sums"], both["compiled"]) == ([4.0, 7.0], 0)


def test_loading_kernels_does_not_import_numba_compiler_modules(package):
    names = "('numba.np.arraymath', 'scipy.linalg')"
    run = f"{OUTER}; import sys; values['imported'] = [name for name in {names} if name in sys.modules]"
    assert "numba.np.arraymath" in package.run(run)["values"]["imported"]  # with compilation
    assert package.run(run)["values"] == {"outer": 7.0, "imported": []}


def test_loaded_kernel_hashes_texts_like_python(package):
    run = "from plant.texts import text_hash; values['equal'] = text_hash(5) == hash('abcde')"
    for compiled in (True, False):
        result = package.run(run)
        assert result["values"] == {"equal": True}
        assert (result["compiled"] > 0) == compiled


@pytest.mark.parametrize(
    ("statements", "file", "old", "new", "after"),
    rest_nightly(
        (OUTER, "plant/outer.py", "1.0", "4.0", {"outer": 10.0}),
        (OUTER, "plant/inner.py", "GAIN * x", "GAIN - x", {"outer": 0.0}),
        (OUTER, "plant/constants.py", "2.0", "5.0", {"outer": 16.0}),
        (OUTER, "plant/__init__.py", "pass", "from plant import constants\nconstants.GAIN = 7.0", {"outer": 22.0}),
        (TOTAL, "plant/law.py", "10.0", "20.0", {"total": 60.0}),
        (TOTAL, "plant/spring.py", "stiffness: float", "stiffness: float = 0.0", {"total": 30.0}),
        (PRODUCT, "plant/inner.py", "GAIN * x", "GAIN - x", {"product": [2.0, 5.0]}), keep=4,),
)  # fmt: skip
def test_edit_of_reachable_source_recompiles(package, statements, file, old, new, after):
    package.run(statements)
    package.edit(file, old, new)
    edited = package.run(statements)
    assert edited["values"] == after
    assert edited["compiled"] > 0
    package.edit(file, new, old)
    assert package.run(statements)["compiled"] == 0  # the cache has both versions


def test_generated_function_is_compiled_once(package):
    """It has a function as an argument, too."""
    run = "from plant.tuples import {0}; values['{0}'] = {0}(3.0)"
    assert package.run(run.format("products"))["values"] == {"products": [18.0, 9.0]}
    other = package.run(run.format("last"))
    assert (other["values"], other["compiling"]) == ({"last": 9.0}, ["plant.tuples.last"])
    package.edit("plant/tuples.py", "factor * x", "factor + x")
    assert package.run(run.format("last"))["values"] == {"last": 6.0}


def test_edit_of_unreachable_source_compiles_no_kernel(package):
    package.run(OUTER)
    package.edit("plant/law.py", "10.0", "20.0")
    package.edit("plant/factory.py", "n * inner", "n + inner")
    assert package.run(OUTER)["compiled"] == 0


def test_loaded_kernel_contains_its_noinline_functions(package):
    run = """
from plant.outermost import outermost
try:
    outermost(-1.0)
except ValueError as error:
    values["refused"] = str(error)
values["outermost"] = outermost(3.0)
"""
    assert package.run(run)["values"] == {"refused": "below zero", "outermost": 46.0}
    package.edit("plant/outermost.py", "1.0", "2.0")
    edited = package.run(run)
    assert edited["values"] == {"refused": "below zero", "outermost": 47.0}
    assert edited["compiling"] == ["plant.outermost.outermost"]


def test_constant_set_by_another_module_recompiles(package):
    package.run(OUTER)
    other = package.run(f"import plant.inner; plant.inner.GAIN = 100.0\n{OUTER}")
    assert other["values"] == {"outer": 301.0}
    assert package.run(OUTER)["values"] == {"outer": 7.0}


def test_implementation_of_another_module_recompiles(package):
    package.run(TOTAL)
    (package.folder / "other.py").write_text(
        "import plant.law\nfrom lapwing.kernels import always_inline\n\n"
        "@always_inline\ndef law(p):\n    return -p.stiffness\n\n"
        "plant.law.FORCES[plant.law.Spring] = law\n"
    )
    assert package.run(f"import other\n{TOTAL}")["values"] == {"total": -3.0}
    assert package.run(TOTAL)["values"] == {"total": 30.0}


def test_source_changed_during_run_is_not_stored(package):
    edit = "import plant.outer; open('plant/constants.py', 'w').write('GAIN = 5.0')"
    running = package.run(f"{edit}\n{OUTER}")
    assert running["values"] == {"outer": 7.0}  # read before the edit
    assert package.run(OUTER)["values"] == {"outer": 16.0}


def test_damaged_file_is_recompiled_and_replaced(package):
    package.run(ALL)
    whole = {path: path.read_bytes() for path in files(package)}
    assert len(whole) > 8
    cuts = {
        "empty": lambda data: b"",
        "half": lambda data: data[: len(data) // 2],
        "short": lambda data: data[:-1],
        "first": lambda data: bytes([data[0] ^ 1]) + data[1:],
        "middle": lambda data: data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 16]) + data[len(data) // 2 + 1 :],
        "last": lambda data: data[:-1] + bytes([data[-1] ^ 0x80]),
    }  # fmt: skip
    for cut in cuts.values():
        for path, data in whole.items():
            path.write_bytes(cut(data))
        run = package.run(ALL)
        assert run["values"] == VALUES
        assert run["loaded"] == 0
        assert package.run(ALL)["compiled"] == 0  # the entries were replaced


def test_version_with_missing_name_does_not_affect_others(package):
    (package.folder / "gone.py").write_text("from typing import NamedTuple\n\nclass Gone(NamedTuple):\n    x: float\n")
    read = "from lapwing.kernels.cell import Cell, read; values['read'] = read(Cell(2.0))"
    package.run(f"{read}; import gone; values['gone'] = read(Cell(gone.Gone(1.0)))[0]")
    (package.folder / "gone.py").unlink()
    run = package.run(read)
    assert (run["values"], run["compiled"]) == ({"read": 2.0}, 0)


def test_simultaneous_processes_compile_each_kernel_once(package):
    alone = package.run(ALL)
    shutil.rmtree(package.cache)
    ended = [package.end(process) for process in [package.start(ALL) for _ in range(4)]]
    assert [run["values"] for run in ended] == [VALUES] * 4
    assert sum(run["compiled"] for run in ended) == alone["compiled"]  # each kernel once
    assert not list((package.cache / "compiling").iterdir())
    last = package.run(ALL)
    assert (last["values"], last["compiled"]) == (VALUES, 0)
    assert all(
        path.name.count(".") == path.name.rpartition("-")[0].count(".") for path in files(package)
    )  # no temporary files


SLOW = "from plant.slow import slow; values['slow'] = slow(2.0)"


@pytest.fixture
def compiling(package):
    """Yield a process that is compiling `slow`."""
    started = package.folder / "begun"
    process = package.start(SLOW, BEGUN=str(started))
    while not started.exists():
        assert process.poll() is None
        time.sleep(0.01)
    yield process
    process.kill()
    process.communicate()


def test_process_waits_for_compiling_process(package, compiling):
    other = package.start(SLOW)
    with pytest.raises(subprocess.TimeoutExpired):
        other.wait(5.0)
    compiling.kill()
    ended = package.end(other)
    assert (ended["values"], ended["compiled"]) == ({"slow": 3.0}, 2)  # `slow`, and the function written for `held`


def test_process_does_not_wait_for_suspended_compiling_process(package, compiling):
    compiling.send_signal(signal.SIGSTOP)
    ended = package.run(f"from lapwing.kernels.compiler import file_locks; file_locks.PATIENCE = 0.1; {SLOW}")
    assert (ended["values"], ended["compiled"]) == ({"slow": 3.0}, 2)  # `slow`, and the function written for `held`


def test_read_only_cache_compiles_all_kernels(package):
    package.cache.write_text("a file where the folder should be")
    assert package.run(OUTER)["values"] == {"outer": 7.0}
    elsewhere = package.run(OUTER, LAPWING_CACHE="", HOME="/dev/null/none")
    assert (elsewhere["values"], elsewhere["loaded"]) == ({"outer": 7.0}, 0)
    homeless = "from pathlib import Path\ndef home(): raise RuntimeError\nPath.home = home\n"
    assert package.run(homeless + OUTER, LAPWING_CACHE="")["values"] == {"outer": 7.0}


def test_cache_is_private_to_user(package):
    package.run(OUTER)
    folders = [package.cache, *(path for path in package.cache.rglob("*") if path.is_dir())]
    assert {stat.S_IMODE(path.stat().st_mode) for path in folders} == {0o700}


def test_entry_writable_for_others_is_not_executed(package):
    package.run(ALL)
    for path in files(package):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        path.chmod(0o666)
    assert package.run(ALL)["loaded"] == 0
    assert package.run(ALL)["compiled"] == 0  # from new private files
    if os.geteuid() == 0:
        for path in files(package):
            os.chown(path, 1, 1)
        assert package.run(ALL)["loaded"] == 0


def test_only_last_versions_are_kept(package):
    for gain in range(7):
        package.edit("plant/constants.py", f"GAIN = {2 + gain}.0", f"GAIN = {3 + gain}.0")
        assert package.run(OUTER)["values"] == {"outer": 3.0 * (3 + gain) + 1.0}
    assert len(list((package.cache / "imports").glob("plant.constants-*"))) == 4


def test_cache_of_numba_is_unchanged(package):
    (package.folder / "own.py").write_text(
        "from numba import njit\n\n@njit(cache=True)\ndef own(x):\n    return x + 1.0\n"
    )
    settings = "import numba; from numba.core import caching; from lapwing.kernels.cell import Cell; Cell(1.0)"
    untouched = "values['settings'] = [numba.config.CACHE_DIR, caching.IndexDataCacheFile._load_index.__module__]"
    run = package.run(f"{settings}; {untouched}; import own; values['own'] = own.own(1.0)")
    assert run["values"] == {"settings": ["", "numba.core.caching"], "own": 2.0}
    assert list((package.folder / "__pycache__").glob("own.own-*.nbc"))
    assert not list(package.cache.rglob("*own*"))


def test_kernel_of_script_is_compiled_in_every_process(package):
    inside = "from lapwing.kernels import kernel; from typing import NamedTuple\n"
    inside += "class Here(NamedTuple):\n    x: float\n\n@kernel\ndef here(x):\n    return x.x * 2.0\n"
    inside += "values['here'] = here(Here(2.0))"
    first, second = package.run(inside), package.run(inside)
    assert first["values"] == second["values"] == {"here": 4.0}
    assert second["compiled"] == first["compiled"] == 1


def test_copied_sources_share_cache(package, tmp_path_factory):
    package.run(OUTER)
    other = tmp_path_factory.mktemp("copy")
    shutil.copytree(package.folder, other, dirs_exist_ok=True)
    package.folder, kept = other, package.cache
    assert package.run(OUTER, LAPWING_CACHE=str(kept))["compiled"] == 0


def test_kernels_of_wheel_are_loaded_with_empty_cache(package, tmp_path):
    package.run(ALL)
    shipped = package.cache.rename(tmp_path / "shipped")
    placed = (
        "from pathlib import Path; from lapwing.kernels.compiler import cache_files;"
        f"cache_files.SHIPPED = Path({str(shipped)!r})\n"
    )
    run = package.run(placed + ALL)
    assert (run["values"], run["compiled"]) == (VALUES, 0)
    assert not files(package)
