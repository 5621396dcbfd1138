"""Recordings from files of any known format."""

from pathlib import Path

from lapwing.studies.flight_import.column_mapping import load_mapping
from lapwing.studies.flight_import.csv_flight import read_csv_flight
from lapwing.studies.flight_import.log_flight import read_log_flight
from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.flight_import.ulog_flight import read_ulog_flight


def open_flight(path: Path, mapping: str | None = None) -> Recording:
    """Read a flight: a Lapwing log (.mcap), a ULog file (.ulg), or a CSV file (.csv, .csv.gz) with a mapping.

    Raises:
        ValueError: unknown format, no mapping for a CSV file, or an invalid file.
    """
    if path.suffix == ".mcap":
        return read_log_flight(path)
    if path.suffix == ".ulg":
        return read_ulog_flight(path)[0]
    if path.name.endswith((".csv", ".csv.gz")):
        if mapping is None:
            raise ValueError(f"{path}: a CSV file needs --mapping; use a name that ships, or a .toml file")
        return read_csv_flight(path, load_mapping(mapping))
    raise ValueError(f"{path}: unknown format; expected .ulg, .mcap, or .csv and .csv.gz with --mapping")
