"""Files that commands write: refused before the work, not after it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lapwing.cosim.scene import Scene


def log_path(scene: "Scene", given: Path | None, exists: bool) -> Path:
    """Where the log goes; a path that cannot be written is refused now, not after the flight."""
    import time

    stamp = time.strftime("%Y-%m-%dT%H-%M-%S")
    path = given or Path("recordings") / f"{scene.name}_{stamp}.mcap"
    if not exists:
        with left_as_it_was(path):
            check_writable(path)
    return path


@contextmanager
def left_as_it_was(log: Path) -> Iterator[None]:
    """Make the folder of recordings where it is missing; leave neither it nor an empty log when a run is refused."""
    new_log, new_folder = not log.exists(), log.parent == Path("recordings") and not log.parent.exists()
    refused = False
    try:
        if new_folder:
            log.parent.mkdir()
        yield
    except OSError as error:
        raise ValueError(f"{log}: cannot be written: {(error.strerror or str(error)).lower()}") from None
    except ValueError:
        refused = not _has_flown(log)
        raise
    finally:
        if new_log and refused:
            log.unlink(missing_ok=True)
        if new_folder and log.parent.is_dir() and not any(log.parent.iterdir()):
            log.parent.rmdir()


def _has_flown(log: Path) -> bool:
    """Whether a log holds anything of a flight."""
    from lapwing.cosim.log import LogReader

    try:
        with LogReader(log) as read:
            return bool(read.deterministic_topics())
    except ValueError:
        return False


def written(path: Path) -> int | None:
    """When a file was written last [ns]; None where it is not there."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return None


def check_distinct(paths: dict[str, Path | None]) -> None:
    """Refuse two options that name the same file."""
    names: dict[Path, str] = {}
    for option, path in paths.items():
        if path is not None and (other := names.setdefault(path.resolve(), option)) != option:
            raise ValueError(f"{option} {path}: is the same file as {other}; choose another")


def check_writable(path: Path | None) -> None:
    """Refuse a file that cannot be written, before anything is done for it."""
    if path is None:
        return
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; expected the name of a file to write")
    there = path.exists()
    try:
        path.open("ab").close()
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {(error.strerror or str(error)).lower()}") from None
    if not there:
        path.unlink()


def check_plot(path: Path | None) -> None:
    """Refuse a picture that is no .png, .svg or .pdf, or cannot be written."""
    if path is not None and path.suffix not in (".png", ".svg", ".pdf"):
        raise ValueError(f"--plot {path}: expected a name that ends in .png, .svg or .pdf")
    check_writable(path)


def check_report(option: str, path: Path | None) -> None:
    """Refuse a report that cannot be written, or whose name has an ending that no report has."""
    if path is not None:
        from lapwing.studies.report import check_format

        try:
            check_format(path)
        except ValueError as error:
            raise ValueError(f"{option} {error}") from None
    check_writable(path)
