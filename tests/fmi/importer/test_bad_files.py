"""Damaged and hostile FMU files are rejected in one line with exit code 2, before any of their code runs."""

import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from small_fmu import write_small_fmu

from tests.combinations import rest_nightly
from tests.commands import assert_rejected, run_command

pytest.importorskip("fmpy")

HOVER = Path("lapwing/scenes/hover.toml").resolve()
SERVICE = """
[services.motor]
fmu = "bad.fmu"
[services.motor.outputs]
"actuators.motor_voltage.0" = "y"
"""
LIBRARY, XML = "binaries/linux64/small.so", "modelDescription.xml"
BOMB = '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;&b;">]>'
Files = dict[str, bytes]


def with_file(name: str, change: Callable[[bytes], bytes]) -> Callable[[Files], Files]:
    return lambda files: files | {name: change(files.get(name, b""))}


def without(name: str) -> Callable[[Files], Files]:
    return lambda files: {key: value for key, value in files.items() if key != name}


def replaced(before: str, after: str) -> Callable[[Files], Files]:
    return with_file(XML, lambda text: text.replace(before.encode(), after.encode(), 1))


def on_arm(library: bytes) -> bytes:
    return library[:18] + struct.pack("<H", 183) + library[20:]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    path = tmp_path_factory.mktemp("fmu") / "small.fmu"
    write_small_fmu(path)
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def assert_fmu_rejected(folder: Path, message: str) -> None:
    scene = folder / "bad.toml"
    scene.write_text(HOVER.read_text() + SERVICE)
    done = run_command("run", scene, "--allow-code", "--log", folder / "a.mcap")
    assert_rejected(done, "services.motor.fmu: ", message)
    assert not (folder / "a.mcap").exists()


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "message"),
    rest_nightly(
        (without(XML), "has no file modelDescription.xml; expected an FMU"),
        (without(LIBRARY), "has binaries for no platform; expected an FMU for Linux on x86-64"),
        (with_file(LIBRARY, on_arm), f"{LIBRARY} is not a library for x86-64"),
        (with_file(LIBRARY, lambda _: b""), f"{LIBRARY} is not a library for x86-64"),
        (replaced('Identifier="small"', 'Identifier="big"'), "has no file binaries/linux64/big.so"),
        (replaced('Identifier="small"', 'Identifier="../../a"'), "modelIdentifier '../../a'; expected letters"),
        (replaced("<fmiModel", f"{BOMB}<fmiModel"), "declares a document type; expected XML without entities"),
        (replaced('fmiVersion="2.0"', 'fmiVersion="1.0"'), "FMI 1.0; expected an FMU of version 2.0 or 3.0"),
        (replaced("fmiModelDescription", "model"), "modelDescription.xml does not describe a model"),
        (replaced("</ScalarVariable>", ""), "not an FMU: Opening and ending tag mismatch"),
        (with_file("../evil.so", lambda _: b"x"), "file '../evil.so' is outside the FMU"),
        (with_file("/tmp/evil.so", lambda _: b"x"), "file '/tmp/evil.so' is outside the FMU"),
        (with_file("resources\\a", lambda _: b"x"), "is outside the FMU"),
        keep=3,
    ),
)
def test_hostile_fmu_is_rejected_in_one_line(
    tmp_path: Path, files: Files, change: Callable[[Files], Files], message: str
) -> None:
    with zipfile.ZipFile(tmp_path / "bad.fmu", "w") as archive:
        for name, content in change(files).items():
            archive.writestr(name, content)
    assert_fmu_rejected(tmp_path, message)


def test_fmu_that_unpacks_beyond_limit_is_rejected_in_one_line(tmp_path: Path, files: Files) -> None:
    """The directory of the archive lists 4 files of 1.5 GB, of which it has no data."""
    path = tmp_path / "bad.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
        for k in range(4):
            archive.writestr(f"resources/{k}", b"x")
            archive.filelist[-1].file_size = 1_500_000_000
    assert_fmu_rejected(tmp_path, "its files have 6 GB; expected at most 4 GB")


def test_large_file_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "bad.fmu").open("wb") as file:
        file.truncate(5_000_000_000)  # without blocks on the disk
    assert_fmu_rejected(tmp_path, "has 5 GB; expected at most 4 GB")


@pytest.mark.long
def test_damaged_fmu_member_is_rejected_in_one_line(tmp_path: Path, files: Files) -> None:
    path = tmp_path / "bad.fmu"
    table = "resources/table.csv"  # no part that is read before the FMU is extracted
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (files | {table: b"time,voltage\n0,12\n"}).items():
            archive.writestr(name, content)
    whole = path.read_bytes()
    for name, place in ((LIBRARY, whole.index(b"\x7fELF") + 5000), (table, whole.index(b"time,voltage"))):
        content = bytearray(whole)
        content[place] ^= 0xFF
        path.write_bytes(content)
        assert_fmu_rejected(tmp_path, f"file {name} is damaged; expected a complete FMU")
    path.write_bytes(content[: len(content) // 2])
    assert_fmu_rejected(tmp_path, "not an FMU: File is not a zip file")
