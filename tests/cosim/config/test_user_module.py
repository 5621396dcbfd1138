"""User modules: found in the scene folder or on the path, stored as text, and executed from it."""

import os
import py_compile
import stat
import sys
from pathlib import Path

import pytest

from lapwing.cosim.config import user_module
from lapwing.cosim.config.user_module import find, load
from lapwing.dynamics.config_error import ConfigError


def test_module_and_its_imports_are_found_in_scene_folder(tmp_path):
    (tmp_path / "own_law.py").write_text("import math\nfrom own_helper import two\nimport own_missing\n")
    (tmp_path / "own_helper.py").write_text("import own_law\ntwo = 2\n")
    result = find("key", "own_law", tmp_path)
    assert list(result) == ["own_law", "own_helper"]
    assert result["own_helper"] == tmp_path / "own_helper.py"


def test_module_is_found_on_python_path(tmp_path, monkeypatch):
    (tmp_path / "own_elsewhere.py").write_text("x = 1")
    monkeypatch.syspath_prepend(tmp_path)
    assert find("key", "own_elsewhere", tmp_path / "scenes") == {"own_elsewhere": tmp_path / "own_elsewhere.py"}


@pytest.mark.parametrize(
    ("name", "output"),
    [
        ("own_nowhere", "key: no module own_nowhere; expected"),
        ("numpy", "another module has this name; expected a unique name"),
        ("math", "another module has this name"),
        ("a-b", "expected a name that Python can import, got module 'a-b'"),
    ],
)
def test_invalid_module_is_rejected(tmp_path, name, output):
    for taken in ("numpy", "math"):
        (tmp_path / f"{taken}.py").write_text("")
    with pytest.raises(ConfigError) as caught:
        find("key", name, tmp_path)
    assert output in str(caught.value)


def test_stored_text_is_executed_with_neighbours():
    texts = {"own_first": "from own_second import value\n", "own_second": "value = 3\n"}
    assert load("own_first", texts).value == 3
    assert load("own_first", texts) is sys.modules["own_first"]


def test_changed_text_is_executed_again():
    load("own_first", {"own_first": "from own_second import value\n", "own_second": "value = 3\n"})
    assert load("own_first", {"own_first": "from own_second import value\n", "own_second": "value = 4\n"}).value == 4


def test_damaged_cache_file_is_replaced():
    module = load("own_kept", {"own_kept": "value = 5\n"})
    for damage in (b"value = 6\n", b"\xff"):
        Path(module.__file__).write_bytes(damage)
        del sys.modules["own_kept"]
        assert load("own_kept", {"own_kept": "value = 5\n"}).value == 5


@pytest.mark.parametrize("kept", [None, Path("/dev/null/none")])
def test_private_folder_replaces_missing_cache(kept, monkeypatch):
    monkeypatch.setattr(user_module, "cache_folder", lambda: kept)
    module = load("own_homeless", {"own_homeless": f"value = 7\nkept = {str(kept)!r}\n"})
    assert module.value == 7
    assert stat.S_IMODE(Path(module.__file__).parents[1].stat().st_mode) == 0o700


def test_files_writable_by_others_are_not_executed(monkeypatch, tmp_path):
    monkeypatch.setattr(user_module, "cache_folder", lambda: tmp_path)
    text = "value = 8\n"
    file = Path(load("own_planted", {"own_planted": text}).__file__)
    assert file.is_relative_to(tmp_path)
    written = file.stat()
    file.write_text("value = 9\n")  # byte code of another text, which Python would use for this one
    os.utime(file, ns=(written.st_atime_ns, written.st_mtime_ns))
    py_compile.compile(str(file))
    file.write_text(text)
    os.utime(file, ns=(written.st_atime_ns, written.st_mtime_ns))
    file.parent.chmod(0o777)
    del sys.modules["own_planted"]
    sys.path.remove(str(file.parent))
    module = load("own_planted", {"own_planted": text})
    assert module.value == 8
    assert not Path(module.__file__).is_relative_to(tmp_path)
