"""The report against a flight made by formula: its figures are known without the code under test."""

import base64
import math
from html.parser import HTMLParser

import made_up
import numpy as np
import pytest
from matplotlib.figure import Figure

from cosim.log import LogWriter
from cosim.provenance import attachments as attachments_of
from messages import Actuators, Estimate, Imu, Point, Pose, Quaternion, Setpoint, Status, Vector3, VehicleState, header
from studies.flight import AXES, Flight
from studies.report import picture, plots, write
from studies.report.plots import estimator, propulsion
from studies.report.style import POINTS, line, phases

RATE, SECONDS = 50, 6.0
OFFSET = (0.1, -0.2, 0.05, 0.01, -0.02, 0.03)  # reference minus truth, so the errors are these numbers
THRUST, TORQUE = 2e-4, 8e-6  # over speed squared
BELIEVED = 0.02  # estimate minus truth of x [m]
SETUP = made_up.setup(
    int(RATE * SECONDS) + 1,
    RATE,
    run={"title": "a circle <by> formula"},
    published={"source": "paper, Table 7", "rmse": {"x": 0.2373, "yaw": 0.0220}},
)
METADATA = {"scene": "circle", "seed": "7", "mode": "single", "solver_integrator": "rk4", "solver_step": "0.001"}


def rotation(roll, pitch, yaw):
    """Quaternion of yaw, then pitch, then roll about the turned axes, from the textbook's formula."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return Quaternion(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def messages(std=0.05, rotors=4, reference=True):
    """Topic and message, tick by tick: a circle whose angles swing; the motors are armed from 1 s on."""
    for tick in range(int(RATE * SECONDS) + 1):
        t = tick / RATE
        stamp = header(tick * 1_000_000_000 // RATE, "world")
        position = (math.cos(t), math.sin(t), 1.0 + 0.1 * t)
        angles = (0.1 * math.sin(t), 0.1 * math.cos(t), 0.2 * t)
        speed = (300.0 + 50.0 * math.sin(t),) * rotors
        pose = Pose(Point(*position), rotation(*angles))
        truth = VehicleState(stamp, pose)._replace(
            rotor_speed=speed,
            motor_voltage=tuple(0.1 * w for w in speed),
            motor_current=tuple(0.03 * w for w in speed),
            motor_power=tuple(1e-5 * w**3 for w in speed),
            rotor_thrust=tuple(THRUST * w**2 for w in speed),
            rotor_torque=tuple(TORQUE * w**2 for w in speed),
            wind=Vector3(3.0, math.sin(t), 0.0),
            air_density=1.2,
            ground_contact=t >= SECONDS,
        )
        yield "truth", truth
        asked = [value + offset for value, offset in zip(position + angles, OFFSET, strict=True)]
        if reference:
            phase = "climb" if t < 3.0 else "hover"
            yield "setpoint", Setpoint(stamp)._replace(position=Vector3(*asked[:3]), yaw=asked[5], phase=phase)
            yield (
                "actuators",
                Actuators(stamp)._replace(armed=t >= 1.0, attitude_reference=Vector3(asked[3], asked[4], 0.0)),
            )
        if tick % 5 == 0:
            estimated = pose._replace(position=Point(position[0] + BELIEVED, *position[1:]))
            wrong = ("gps", "sonar") if tick == 50 else ("gps",) if tick == 100 else ()
            spread = dict.fromkeys(("position_std", "velocity_std", "attitude_std"), Vector3(std, std, std))
            yield "estimate", Estimate(stamp, estimated)._replace(rejected=wrong, **spread)
            yield "status", Status(stamp)._replace(landed=t >= SECONDS, finished=t >= SECONDS)


def record(path, entries, attachments=None):
    with LogWriter(path, METADATA, attachments_of(SETUP, {}) if attachments is None else attachments) as log:
        for topic, message in entries:
            instant = message.header.stamp
            time_ns = instant.sec * 1_000_000_000 + instant.nanosec
            log.write(f"/drone1/{topic}", type(message), message.encode(), time_ns)
            log.flush() if topic == "status" and time_ns % 1_000_000_000 == 0 else None
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return record(tmp_path_factory.mktemp("log") / "circle.mcap", messages())


class Page(HTMLParser):
    """What a browser would find: texts, images, addresses; unclosed elements are an error."""

    def __init__(self, path):
        super().__init__()
        self.images, self.addresses, self.texts, self.tags, self.ids = {}, [], [], [], []
        self._open = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        found = dict(attrs)
        if tag == "section":
            self.ids.append(found["id"])
        self.addresses += [v for k, v in attrs if k in ("src", "href", "srcset", "data", "action")]
        if tag == "img":
            self.images[self.ids[-1]] = found["src"]
        if tag not in ("meta", "img", "link"):
            self._open.append(tag)

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if data.strip():
            self.texts.append(data.strip())

    def after(self, text):
        """The text that follows `text`: a table's value after its name."""
        return self.texts[self.texts.index(text) + 1]


def report(log):
    """The report of a log, written beside it."""
    return write(Flight.read(log), log.with_suffix(".html"))


@pytest.fixture(scope="module")
def page(log):
    return Page(report(log))


def test_every_plot_is_on_the_page_in_its_order_as_png(page):
    of_multirotors = [m for m in plots.modules() if "reduced" in getattr(m, "MODELS", ("reduced",))]
    names = [module.__name__.rpartition(".")[2] for module in of_multirotors]
    assert page.ids == names
    assert list(page.images) == names
    assert names[0] == "displacements"
    for source in page.images.values():
        kind, data = source.split(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG\r\n\x1a\n")


def test_the_page_needs_nothing_from_elsewhere(page):
    assert page.addresses == list(page.images.values())
    assert not {"script", "link", "iframe"} & set(page.tags)
    assert not any("url(" in text or "@import" in text for text in page.texts)


def test_errors_are_the_offsets_that_were_flown(log, page):
    for axis, unit, offset in zip(AXES, ("m", "m", "m", "rad", "rad", "rad"), OFFSET, strict=True):
        assert page.after(f"{axis} [{unit}]") == f"{abs(offset):.4f}"
        assert Flight.read(log).rmse[axis] == pytest.approx(abs(offset), rel=1e-9)
        assert Flight.read(log).errors[axis] == pytest.approx(offset, rel=1e-9)  # also its sign
    assert page.after(page.after("x [m]")) == "0.2373"
    assert page.after(page.after("y [m]")) != "0.2700"  # nothing published for y in this scene


def test_summary_says_what_the_log_says(log, page):
    flown = Flight.read(log)
    assert page.after("digest") == flown.digest
    assert page.after("duration") == "6.00 s"
    assert page.after("landed") == "yes"
    assert page.after("seed") == "7"
    assert page.after("solver") == "rk4, step 0.001 s"
    assert any("a circle <by> formula" in text for text in page.texts)  # escaped, not swallowed as an element


def test_armed_samples_alone_count(log):
    assert Flight.read(log).armed.sum() == RATE * (SECONDS - 1.0) + 1
    assert all(len(e) == Flight.read(log).armed.sum() for e in Flight.read(log).errors.values())


def test_phases_follow_one_another(log):
    assert phases(Flight.read(log)) == [("climb", 0.0, 3.0), ("hover", 3.0, pytest.approx(SECONDS))]


def test_coefficients_are_those_of_the_propeller(log):
    flown = Flight.read(log)
    speed = flown.truth.rotor_speed[:, 0]
    assert propulsion.coefficient(speed, flown.truth.rotor_thrust[:, 0], 2) == pytest.approx(THRUST)
    assert propulsion.coefficient(speed, flown.truth.rotor_torque[:, 0], 2) == pytest.approx(TORQUE)


def test_estimate_errors_and_refusals(log):
    error = estimator.errors(Flight.read(log))
    expected = np.zeros(9)
    expected[0] = BELIEVED
    assert error == pytest.approx(np.broadcast_to(expected, error.shape), abs=1e-9)
    assert estimator.refusals(Flight.read(log)) == "Measurements refused: gps 2, sonar 1."


def test_attitude_error_is_in_the_body_frame(tmp_path):
    """Truth yawed by 90 degrees; an estimate rolled 0.1 rad further about the body's x axis errs by (0.1, 0, 0)."""
    c = math.cos(math.pi / 4)
    true, roll = Quaternion(x=0.0, y=0.0, z=c, w=c), (math.sin(0.05), math.cos(0.05))
    estimated = Quaternion(x=c * roll[0], y=c * roll[0], z=c * roll[1], w=c * roll[1])  # true * roll, by hand
    stamp = header(0, "world")
    both = [
        ("truth", VehicleState(stamp, Pose(Point(), true))),
        ("estimate", Estimate(stamp, Pose(Point(), estimated))),
    ]
    later = [(topic, m._replace(header=header(10**9, "world"))) for topic, m in both]
    error = estimator.errors(Flight.read(record(tmp_path / "yawed.mcap", both + later)))
    assert error[:, 6:] == pytest.approx(np.array([[0.1, 0.0, 0.0]] * 2), abs=1e-12)


def test_a_truncated_log_gives_a_report_too(log, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    page = Page(report(cut))
    assert page.after("landed") == "no"
    assert page.after("digest") == "none: the log has no end"
    assert 0.0 < float(page.after("duration").removesuffix(" s")) < SECONDS
    assert page.after("x [m]") == "0.1000"
    assert "displacements" in page.images


def test_what_is_missing_is_said(tmp_path):
    page = Page(report(record(tmp_path / "bare.mcap", messages(std=0.0, rotors=0, reference=False), {})))
    text = " ".join(page.texts)
    assert set(page.images) == {"displacements", "angles", "path", "air"}
    assert "Left out: the log has no topic setpoint, actuators." in text
    assert "Left out: the vehicle has no motors." in text
    assert "Left out: the estimate states no uncertainty (it is the truth)." in text
    assert "No reference in this log" in text


def test_a_single_sample_is_enough(tmp_path):
    page = Page(report(record(tmp_path / "short.mcap", list(messages())[:5])))
    assert page.after("duration") == "0.00 s"
    assert "displacements" in page.images


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(None, "cannot read the log"), (b"no log", "not an MCAP file")],
    ids=["missing", "foreign"],
)
def test_a_file_that_is_no_log_is_refused(tmp_path, content, complaint):
    path = tmp_path / "x.mcap"
    if content:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=complaint) as fault:
        report(path)
    assert str(path) in str(fault.value)
    assert "\n" not in str(fault.value)
    assert not path.with_suffix(".html").exists()


def test_a_log_without_a_flight_is_refused(tmp_path):
    path = record(tmp_path / "imu.mcap", [("imu", Imu(header(0, "drone1")))])
    with pytest.raises(ValueError, match="no flight in this log"):
        report(path)


def test_a_damaged_scene_is_named(tmp_path):
    path = record(tmp_path / "scene.mcap", messages(), {"setup.json": b"[run"})
    with pytest.raises(ValueError, match=r"scene\.mcap: its attachment setup\.json cannot be read"):
        report(path)


def test_a_report_that_cannot_be_written_is_one_line(log, tmp_path):
    copy = tmp_path / "a.mcap"
    copy.write_bytes(log.read_bytes())
    copy.with_suffix(".html").mkdir()
    with pytest.raises(ValueError, match=r"a\.html: cannot write the report: "):
        report(copy)


def test_the_picture_of_a_mission_is_a_png(log, tmp_path):
    picture.draw(Flight.read(log), tmp_path / "mission.png")
    assert (tmp_path / "mission.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


@pytest.mark.parametrize("count", [POINTS, POINTS + 1, 17051])
def test_thinning_a_line_keeps_its_peaks_and_ends(count):
    t = np.linspace(0.0, 1.0, count)
    y = np.sin(50.0 * t)
    y[count // 3], y[-2] = 9.0, -9.0
    axes = Figure().add_subplot()
    line(axes, t, y)
    drawn_t, drawn_y = axes.lines[0].get_data()
    assert len(drawn_t) <= POINTS + 2
    assert (np.diff(drawn_t) > 0.0).all()
    assert (drawn_t[0], drawn_t[-1]) == (0.0, 1.0)
    assert set(zip(drawn_t, drawn_y, strict=True)) <= set(zip(t, y, strict=True))
    assert (drawn_y.max(), drawn_y.min()) == (9.0, -9.0)
