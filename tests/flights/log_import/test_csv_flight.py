"""Flights in CSV files: dialects, columns, faults, time."""

import codecs
import gzip

import numpy as np
import pytest
from flight_recordings import INTERVAL, real_flights, simulated, write_csv
from scipy.interpolate import CubicSpline

from lapwing.flights.log_import.column_mapping import load_mapping
from lapwing.flights.log_import.csv_flight import from_columns, read_csv_flight
from lapwing.flights.log_import.csv_table import read_columns
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.log_import.time_alignment import clock_drift, time_offset
from lapwing.flights.rotation_arrays import from_ned_frd, from_vector, product, rotate, rotation_vector
from lapwing.studies.validation.plant_rows import PlantRows


@pytest.fixture(scope="module")
def flight():
    return simulated(PlantRows("crazyflie_21", INTERVAL), 6.0, [1])[0]


@pytest.fixture
def path(flight, tmp_path):
    return write_csv(tmp_path / "flight.csv", flight)


def edited(path, column, change):
    lines = path.read_text().splitlines()
    place = lines[0].split(",").index(column)
    rows = [line.split(",") for line in lines[1:]]
    for k, row in enumerate(rows):
        row[place] = change(k, row[place])
    path.write_text("\n".join([lines[0], *map(",".join, rows)]) + "\n")
    return path


def read(path):
    return open_flight(path, "nanobench")


@pytest.mark.long
def test_columns_become_si_quantities(flight, path):
    result = read(path)
    assert result.position == pytest.approx(flight.position, abs=1e-8)
    assert result.attitude == pytest.approx(flight.attitude, abs=1e-8)
    assert result.omega == pytest.approx(flight.omega, abs=1e-8)
    assert result.specific_force == pytest.approx(flight.specific_force, abs=1e-6)
    assert result.motor_voltage == pytest.approx(np.minimum(flight.motor_voltage, 4.3), abs=1e-6)
    assert result.valid.all()


@pytest.mark.long
def test_gzip_has_equal_recording(path, tmp_path):
    packed = tmp_path / "flight.csv.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert np.array_equal(read(packed).position, read(path).position)


@pytest.mark.long
def test_faulty_samples_are_marked_and_counted(path):
    edited(path, "motor_motor_m2", lambda k, v: "1938326" if k == 100 else v)
    edited(path, "pwr_pm_vbat", lambda k, v: "2.04" if 200 <= k < 203 else v)
    edited(path, "px", lambda k, v: "nan" if k == 300 else v)
    result = read(path)
    assert result.faults["motor out of range"] == 1
    assert result.faults["battery out of range"] == 3
    assert result.faults["position not finite"] == 1
    assert not result.valid[[100, 200, 300]].any()
    assert result.valid.mean() > 0.95


@pytest.mark.long
@pytest.mark.parametrize(
    ("column", "change", "message"),
    [
        ("t", lambda k, v: "1000.0" if k == 50 else v, "time runs backwards"),
        ("imu_gyro_x", lambda k, v: str(57.3 * float(v)), "deg/s is suspected"),
        ("px", lambda k, v: "abc" if k == 3 else v, "is not a number"),
    ],
)
def test_wrong_values_are_named(path, column, change, message):
    edited(path, column, change)
    if column == "imu_gyro_x":
        edited(edited(path, "imu_gyro_y", change), "imu_gyro_z", change)
    with pytest.raises(ValueError, match=message):
        read(path)


@pytest.mark.long
@pytest.mark.parametrize(
    ("column", "message"), [("motor_motor_m3", "no motor outputs"), ("vx", "column vx is missing")]
)
def test_missing_column_is_named(path, column, message):
    path.write_text(path.read_text().replace(f"{column},", "unknown,", 1))
    with pytest.raises(ValueError, match=message):
        read(path)


@pytest.mark.long
def test_file_without_rows_is_rejected(path):
    path.write_text(path.read_text().splitlines()[0] + "\n")
    with pytest.raises(ValueError, match="has no rows"):
        read(path)


@pytest.mark.long
def test_ned_frd_attitude_turns_about_same_axes():
    yaw_left_enu = from_ned_frd(from_vector(np.array([[0.0, 0.0, -0.3]])))
    level_north = from_ned_frd(np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert rotate(level_north, np.array([[1.0, 0.0, 0.0]]))[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    turned = product(level_north * [1.0, -1.0, -1.0, -1.0], yaw_left_enu)
    assert rotation_vector(turned)[0] == pytest.approx([0.0, 0.0, 0.3], abs=1e-12)


@pytest.mark.long
def test_time_offset_of_shifted_stream():
    noise = np.random.default_rng(1).standard_normal((2000, 3))
    rate = np.apply_along_axis(lambda c: np.convolve(c, np.ones(9) / 9, "same"), 0, noise)
    offset, score = time_offset(rate, np.roll(rate, 4, axis=0), np.ones(2000, bool), 0.01)
    assert offset == pytest.approx(0.04, abs=1e-3)
    assert score > 0.98


@pytest.mark.long
def test_clock_drift_of_stretched_stream():
    rng = np.random.default_rng(5)
    time = 0.01 * np.arange(12_000)
    knots = np.arange(-1.0, time[-1] + 2.0, 0.15)
    smooth = [CubicSpline(knots, rng.standard_normal(len(knots))) for _ in range(3)]
    turning = np.column_stack([f(time) for f in smooth])
    late = np.column_stack([f(time - 0.02 - 500e-6 * time) for f in smooth]) + 0.1 * rng.standard_normal((12_000, 3))
    drift = clock_drift(turning, late, np.ones(12_000, bool), 0.01)
    assert drift.rate == pytest.approx(500e-6, abs=max(3.0 * drift.standard_error, 5e-6))
    assert drift.standard_error < 20e-6


@pytest.mark.long
def test_clock_drift_of_short_stream_is_unknown():
    turning = np.random.default_rng(5).standard_normal((1_000, 3))
    assert clock_drift(turning, turning, np.ones(1_000, bool), 0.01) is None


@pytest.mark.long
def test_unknown_unit_is_named(tmp_path):
    text = '[time]\ncolumn = "t"\nunit = "fortnight"\n'
    mapping = tmp_path / "mine.toml"
    mapping.write_text(text)
    with pytest.raises(ValueError, match=r"mine\.toml"):
        load_mapping(str(mapping))


@pytest.mark.long
def test_real_flights_import_with_their_faults():
    folder = real_flights("nanobench")
    mapping = load_mapping("nanobench")
    result = read_csv_flight(folder / "B2_circle_medium_rep3.csv.gz", mapping)
    assert result.faults["motor out of range"] > 500
    assert result.faults["battery out of range"] > 100
    assert 0.6 < result.valid.mean() < 0.9


@pytest.mark.long
def test_fast_csv_keeps_its_time_base(tmp_path):
    mapping = load_mapping("betaflight")
    n = 3200
    time = np.floor(312.5 * np.arange(n))
    table = {column: np.zeros(n) for column in mapping.columns}
    table |= {"time (us)": time, "accSmooth[2]": np.full(n, 2048.0), "vbatLatest (V)": np.full(n, 16.0)}
    table |= {f"motor[{k}]": np.full(n, 500.0) for k in range(4)} | {"gyroADC[0]": np.sin(time * 1e-6)}
    result = from_columns(tmp_path / "f.csv", table, mapping)
    at = result.interval * np.arange(len(result))
    assert at[-1] == pytest.approx(time[-1] * 1e-6, abs=1e-3)
    assert result.omega[:, 0] == pytest.approx(np.radians(np.sin(at)), abs=1e-6)


ROWS = [(0.0, 1.5, -2.25), (0.01, 1.75, -2.5)]
PLAIN = "t,x,y\n" + "".join(",".join(map(str, row)) + "\n" for row in ROWS)
DECIMAL = "t;x;y\n" + "".join(";".join(map(str, row)).replace(".", ",") + "\n" for row in ROWS)
QUOTED = '"t","x","y"\n' + "".join(",".join(f'"{v}"'.replace(".", ",") for v in row) + "\n" for row in ROWS)


@pytest.mark.parametrize(
    "content",
    [
        codecs.BOM_UTF8 + PLAIN.encode(), PLAIN.encode("utf-16"), PLAIN.replace(",", ";").encode(),
        PLAIN.replace(",", "\t").encode(), DECIMAL.encode(), QUOTED.encode(), b"# of a logger\n" + PLAIN.encode(),
        b"# " + PLAIN.encode(), PLAIN.replace("0.01", "# pause\n0.01").encode(),
    ],
    ids=["bom", "utf16", "semicolon", "tab", "decimal", "quoted", "comment", "header", "rows"],
)  # fmt: skip
def test_form_of_file_is_recognised(tmp_path, content):
    (tmp_path / "f.csv").write_bytes(content)
    table = read_columns(tmp_path / "f.csv", ("t", "x", "y"))
    assert np.column_stack([table["t"], table["x"], table["y"]]) == pytest.approx(np.array(ROWS))


def test_decimal_commas_between_commas_are_named(tmp_path):
    (tmp_path / "f.csv").write_text("t,x\n0,0,1,5\n0,01,1,75\n")
    with pytest.raises(ValueError, match="decimal commas are suspected; separate the fields by semicolons"):
        read_columns(tmp_path / "f.csv", ("t", "x"))
