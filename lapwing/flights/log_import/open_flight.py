"""Recordings from files of all supported formats."""

from dataclasses import replace
from pathlib import Path

from lapwing.flights.log_import.column_mapping import load_mapping
from lapwing.flights.log_import.recording import Recording
from lapwing.flights.log_import.source_choice import Choices

USD_MAPPING = "crazyflie_usd"
CSV = (".csv", ".csv.gz")
FORMATS = (
    ".ulg, .bin, .log, .tlog, .mcap, .db3, a rosbag2 folder, .csv and .csv.gz with --mapping, or a log of the Crazyflie"
)


def open_flight(
    path: Path,
    mapping: str | None = None,
    vehicle: str | None = None,
    choices: Choices = Choices(),  # noqa: B008
) -> Recording:
    """Read a flight, and note why it cannot be validated. The file name's extension selects one of `FORMATS`.

    Args:
        path: path of the file, or of the folder or a single file of a rosbag2.
        mapping: name or file of the columns' mapping, for CSV files and logs of the Crazyflie.
        vehicle: namespace of the vehicle in a rosbag2.
        choices: instances of sensors, and axes of an odometry's velocity.

    Raises:
        ValueError: the format is unknown, a CSV file has no mapping, or the file is invalid.
    """
    flight = _read(path, mapping, vehicle, choices)
    notes = [f"no {', '.join(flight.missing)}: validate and identify use the other signals"] if flight.missing else []
    notes += [f"{flight.obstacle}: the flight cannot be validated"] if flight.obstacle else []
    return replace(flight, notes=(*flight.notes, *notes))


def takes_mapping(path: Path) -> bool:
    """Return True for files whose columns a mapping names: CSV files and logs of the Crazyflie."""
    from lapwing.flights.log_import.usd_log import is_usd_log

    return path.name.endswith(CSV) or (path.is_file() and is_usd_log(path))


def _read(path: Path, mapping: str | None, vehicle: str | None, choices: Choices) -> Recording:
    from lapwing.flights.log_import import csv_flight, usd_log

    if _is_rosbag(path):
        from lapwing.flights.log_import.rosbag_flight import read_rosbag_flight

        return read_rosbag_flight(path, vehicle, choices)
    if choices.twist_frame:
        raise ValueError(f"--twist-frame {choices.twist_frame}: {path} is not a rosbag2; omit the option")
    if vehicle is not None:
        raise ValueError(f"--vehicle {vehicle}: {path} is not a rosbag2; omit the option")
    if not path.is_file():
        message = "is not a regular file" if path.exists() else "no such file"
        raise ValueError(f"{path}: {message}; use the path of a recorded flight")
    if path.name.endswith(CSV):
        if mapping is None:
            raise ValueError(
                f"{path}: a CSV file needs --mapping; use the name of an included mapping, or a .toml file"
            )
        return csv_flight.read_csv_flight(path, load_mapping(mapping), choices)
    ending = path.suffix.lower()
    if ending == ".mcap":
        from lapwing.flights.log_import.log_flight import read_log_flight

        return read_log_flight(path)
    if ending == ".ulg":
        from lapwing.flights.log_import.ulog_flight import read_ulog_flight

        return read_ulog_flight(path, choices)
    if ending in (".bin", ".log"):
        from lapwing.flights.log_import.dataflash_flight import read_dataflash_flight

        return read_dataflash_flight(path, choices)
    if ending == ".tlog":
        from lapwing.flights.log_import.tlog_flight import read_tlog_flight

        return read_tlog_flight(path, choices)
    if usd_log.is_usd_log(path):
        return csv_flight.from_columns(path, usd_log.read_usd_log(path), load_mapping(mapping or USD_MAPPING), choices)
    raise ValueError(f"{path}: unknown format; expected {FORMATS}")


def _is_rosbag(path: Path) -> bool:
    if path.suffix.lower() == ".mcap" and path.is_file():
        from lapwing.flights.log_import.log_flight import is_log

        return not is_log(path)
    return path.is_dir() or (path.suffix.lower() == ".db3" and path.is_file())
