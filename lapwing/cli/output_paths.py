"""Files that commands write: checked, reserved and locked before the work starts."""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import count
from pathlib import Path

from lapwing.cosim.output_lock import OutputLock, is_locked, write_errors

_claims = ExitStack()  # locks of the running command's outputs


def release_claims() -> None:
    """Release the locks of all outputs and remove the outputs that are still empty."""
    _claims.close()


def claim(path: Path | None) -> None:
    """Create and lock a file until the command ends, so that no other process writes it.

    Raises:
        ValueError: it cannot be written, or another process writes it.
    """
    if path is None:
        return
    _create(path)
    with write_errors(path):
        _claims.callback(OutputLock(path).close)


def claim_named(option: str, path: Path | None, ending: str) -> None:
    """Claim the file of an option; raise ValueError unless it has this extension and can be written."""
    if path is not None and path.suffix != ending:
        raise ValueError(f"{option} {path}: expected a name that ends in {ending}")
    claim(path)


def check_not_dash(path: Path | None) -> None:
    """Raise ValueError for "-", which means standard output in other programs and would name a file here."""
    if path is not None and str(path) == "-":
        raise ValueError("-: standard output is not supported here; expected the path of an output")


def create_folder(path: Path, parents: bool = False) -> None:
    """Create a folder unless it exists, and claim it (see `claim_folder`)."""
    check_not_dash(path)
    if path.exists() and not path.is_dir():
        raise ValueError(f"{path}: is a file; expected the path of an output folder")
    with write_errors(path):
        path.mkdir(parents=parents, exist_ok=True)
    claim_folder(path)


def claim_folder(path: Path, shared: bool = False) -> None:
    """Lock an existing folder until the command ends.

    Args:
        path: the folder.
        shared: allow other commands that claim it as shared.

    Raises:
        ValueError: another process writes it.
    """
    with write_errors(path):
        _claims.callback(OutputLock(path, shared).close)


def claim_plot(path: Path | None) -> None:
    """Claim an image file; raise ValueError unless it is a .png, .svg or .pdf file that can be written."""
    if path is not None and path.suffix not in (".png", ".svg", ".pdf"):
        raise ValueError(f"--plot {path}: unknown format; use a name that ends in .png, .svg or .pdf")
    claim(path)


def claim_report(option: str, path: Path | None, log: Path | None = None) -> None:
    """Claim a report.

    Args:
        option: option that names the report.
        path: the report.
        log: log that the name of the report comes from; an error about a lock names it.

    Raises:
        ValueError: unknown format, the report cannot be written, or another process writes it.
    """
    if path is not None and log is not None and is_locked(path):  # the other run has not opened its log yet
        raise ValueError(f"{log}: another process is writing it, or its report; choose another name, or wait for it")
    if path is not None:
        from lapwing.views.report.write import check_format, unavailable

        try:
            check_format(path)
            if log is None and (message := unavailable(path.suffix)):  # a run leaves the one next to its log out
                raise ValueError(message)
        except ValueError as error:
            raise ValueError(f"{option} {error}") from None
    claim(path)


def check_log(path: Path | None) -> None:
    """Raise ValueError if a log cannot be written or another process writes it; its writer locks it."""
    if path is None:
        return
    if path.exists() and not path.is_file() and not path.is_dir():
        raise ValueError(f"{path}: is not a regular file; expected the path of an output file")
    if path.suffix not in ("", ".mcap") and not path.is_dir():
        raise ValueError(f"{path}: is not the name of a log; expected a name that ends in .mcap")
    _create(path)
    with write_errors(path):
        OutputLock(path).close()


def reserve_log(scene: str) -> Path:
    """Create an empty log in `recordings` with a name that no other run has, and return its path."""
    folder = Path("recordings")
    if not folder.exists():
        with write_errors(folder):
            folder.mkdir(exist_ok=True)
        _claims.callback(_remove_empty, folder)
    stem = f"{scene}_{time.strftime('%Y-%m-%dT%H-%M-%S')}"
    for number in count(1):
        path = folder / f"{stem}{f'_{number}' if number > 1 else ''}.mcap"
        with write_errors(path):
            try:
                path.open("xb").close()
            except FileExistsError:
                continue
        _claims.callback(_remove_empty, path)
        return path
    raise AssertionError


@contextmanager
def remove_on_failure(log: Path) -> Iterator[None]:
    """Remove a log that was missing or empty before, if the run fails before its first message."""
    is_new = not log.exists() or log.stat().st_size == 0
    with write_errors(log):
        try:
            yield
        except ValueError:
            if is_new and not is_locked(log) and not _has_messages(log):
                log.unlink(missing_ok=True)
            raise


def check_distinct(paths: dict[str, Path | None]) -> None:
    """Raise ValueError if two options name the same file."""
    names: dict[Path, str] = {}
    for option, path in paths.items():
        if path is not None and (other := names.setdefault(path.resolve(), option)) != option:
            raise ValueError(f"{option} {path}: is the same file as {other}; choose another")


def _create(path: Path) -> None:
    """Create a file unless it exists; the end of the command removes it if it is still empty."""
    check_not_dash(path)
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; expected the path of an output file")
    is_new = not path.exists()
    with write_errors(path):
        path.open("ab").close()
    if is_new:
        _claims.callback(partial(_remove_empty, path))


def _remove_empty(path: Path) -> None:
    """Remove a file or folder that is empty and that no other process writes."""
    if path.is_dir():
        if not any(path.iterdir()):
            path.rmdir()
    elif path.exists() and path.stat().st_size == 0 and not is_locked(path):
        path.unlink(missing_ok=True)


def _has_messages(log: Path) -> bool:
    """Return True if a log has deterministic messages."""
    from lapwing.cosim.log import LogReader

    try:
        with LogReader(log) as reader:
            return bool(reader.deterministic_topics())
    except ValueError:
        return False
