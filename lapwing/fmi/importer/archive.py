"""Zip archive of an FMU, whose files are checked before any of them is used."""

import importlib.util
import io
import re
import zipfile
from pathlib import Path
from typing import Any

from lapwing.dynamics.config_error import ConfigError

DESCRIPTION = "modelDescription.xml"
LARGEST = 4_000_000_000  # [bytes] limit of all files of an FMU together
LARGEST_DESCRIPTION = 100_000_000  # [bytes] limit of modelDescription.xml
BINARIES = {2: "binaries/linux64", 3: "binaries/x86_64-linux"}  # folder by version of FMI
_MACHINE = slice(18, 20)  # position of the machine in an ELF header
_X86_64 = (62).to_bytes(2, "little")


def read_archive(key: str, path: Path, content: bytes) -> tuple[Any, int]:
    """Return FMPy's description of an FMU, and the version of FMI, 2 or 3.

    Args:
        key: key of the FMU in the scene.
        path: path of the FMU, for messages.
        content: content of the file.

    Raises:
        ConfigError: not an FMU, too large, damaged, with paths or entities that lead out of it, not for co-simulation,
            or for another platform.
    """
    if importlib.util.find_spec("fmpy") is None:
        raise ConfigError(key, "FMUs need FMPy", "it installed: pip install lapwing[fmi]")
    import fmpy

    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            _check_files(key, path, archive)
            text = archive.read(DESCRIPTION)
            version = _version(key, path, text)
            model = fmpy.read_model_description(io.BytesIO(content), validate=False)
            if model.coSimulation is None:
                raise ConfigError(key, f"{path}: is not for co-simulation", "an FMU exported for co-simulation")
            _check_library(key, path, archive, version, model.coSimulation.modelIdentifier or "")
        return model, version
    except ConfigError:
        raise
    except Exception as error:  # zipfile, lxml and FMPy raise many
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise ConfigError(key, f"{path}: not an FMU: {reason}", "an FMU") from None


def _check_files(key: str, path: Path, archive: zipfile.ZipFile) -> None:
    files = archive.infolist()
    names = [file.filename for file in files]
    if DESCRIPTION not in names:
        raise ConfigError(key, f"{path}: has no file {DESCRIPTION}", "an FMU")
    if outside := [name for name in names if re.search(r"^/|^\w:|\\|(^|/)\.\.(/|$)", name)]:
        raise ConfigError(key, f"{path}: file {outside[0]!r} is outside the FMU", "relative paths without ..")
    size = 0
    for file in files:
        size += file.file_size
    if size > LARGEST:
        raise ConfigError(key, f"{path}: its files have {size / 1e9:.3g} GB", f"at most {LARGEST / 1e9:g} GB")
    if archive.getinfo(DESCRIPTION).file_size > LARGEST_DESCRIPTION:
        raise ConfigError(key, f"{path}: {DESCRIPTION} is too large", f"at most {LARGEST_DESCRIPTION / 1e6:g} MB")
    if damaged := archive.testzip():
        raise ConfigError(key, f"{path}: file {damaged} is damaged", "a complete FMU")


def _version(key: str, path: Path, text: bytes) -> int:
    """Return the version of FMI of a model description, 2 or 3."""
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise ConfigError(key, f"{path}: {DESCRIPTION} declares a document type", "XML without entities")
    version = re.search(rb"<fmiModelDescription\b[^>]*\bfmiVersion\s*=\s*[\"']([\w.-]*)", text)
    if version is None:
        raise ConfigError(key, f"{path}: {DESCRIPTION} does not describe a model", "an FMU")
    if version[1][:2] not in (b"2.", b"3."):
        raise ConfigError(key, f"{path}: FMI {version[1].decode()}", "an FMU of version 2.0 or 3.0")
    return int(version[1][:1])


def _check_library(key: str, path: Path, archive: zipfile.ZipFile, version: int, identifier: str) -> None:
    """Raise ConfigError unless an FMU has the library `identifier` for this platform."""
    if not re.fullmatch(r"\w+", identifier):
        raise ConfigError(key, f"{path}: modelIdentifier {identifier!r}", "letters, digits and underscores")
    folder, names = BINARIES[version], archive.namelist()
    if not any(name.startswith(f"{folder}/") for name in names):
        folders = {name.split("/")[1] for name in names if name.startswith("binaries/") and name.count("/") > 1}
        listed = ", ".join(sorted(folders)) or "no platform"
        raise ConfigError(key, f"{path}: has binaries for {listed}", "an FMU for Linux on x86-64")
    name = f"{folder}/{identifier}.so"
    if name not in names:
        raise ConfigError(key, f"{path}: has no file {name}", "the library that modelIdentifier names")
    library = archive.read(name)
    if not library.startswith(b"\x7fELF") or library[_MACHINE] != _X86_64:
        raise ConfigError(key, f"{path}: {name} is not a library for x86-64", "an FMU for Linux on x86-64")
