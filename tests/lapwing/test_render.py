"""`lapwing render`: films and pictures of the 3D view, from the command as a process."""

import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import lapwing as package
from lapwing.views.view3d import headless
from lapwing.views.view3d.render import Shot, write_film
from tests.commands import assert_rejected, run_command

pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")
SMALL = ("--size", "160x120")


def run(folder, *words):
    return run_command("render", *words, folder=folder)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Return a log of three seconds of hover."""
    scene = package.load_scene("hover", {"run.duration": 3.0})
    return package.fly(scene).save(tmp_path_factory.mktemp("render") / "hover.mcap")


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--out", "a.avi"), "--out a.avi: expected a name that ends in .mp4, .webp, .gif or .png"),
        (("--out", "a.png", "--camera", "back"), "--camera back: expected follow, orbit, top or onboard"),
        (("--out", "a.png", "--size", "big"), "--size big: expected WIDTHxHEIGHT"),
        (("--out", "a.png", "--size", "161x120"), "--size 161x120: expected even numbers"),
        (("--out", "a.mp4", "--fps", "0"), "--fps 0: expected a number above 0, at most 120"),
        (("--out", "a.mp4", "--speed", "nan"), "--speed nan: expected a number above 0, at most 1000"),
        (("--out", "a.png", "--from", "9"), "expected times of the flight, 0 to 3 s"),
    ],
)
def test_render_rejects_wrong_options_in_one_line(log, tmp_path, words, message):
    done = run(tmp_path, log, *words)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert message in done.stderr
    assert not (tmp_path / words[1]).exists()


def test_film_without_encoder_is_rejected_in_one_line(lapwing, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert_rejected(
        lapwing("render", tmp_path / "none.mcap", "--out", tmp_path / "a.mp4"),
        "a.mp4: needs the encoder of imageio-ffmpeg; pip install lapwing[view3d], or write .webp",
    )


@pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium")
def test_browser_that_ends_is_named():
    with headless.Browser("data:text/html,empty") as browser:
        with pytest.raises(headless.BrowserError, match="script in the browser: Error: never"):
            browser.run('throw new Error("never");')
        browser._process.kill()
        with pytest.raises(headless.BrowserError, match="the headless browser has ended unexpectedly"):
            browser.run("await new Promise(() => {});")


@pytest.mark.long
@pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium")
def test_picture_shows_vehicle_on_ground_under_sky(log):
    from PIL import Image

    other = shutil.copy(log, log.with_name("other.mcap"))
    done = run(log.parent, log, "--out", "a.png", *SMALL, "--from", "2", "--camera", "orbit", "--with", other)
    assert done.returncode == 0, done.stderr
    pixels = np.asarray(Image.open(log.parent / "a.png"), float)
    assert pixels.shape == (120, 160, 3)
    sky, ground, middle = pixels[2, 80], pixels[115, 80], pixels[40:80, 60:100].reshape(-1, 3)
    assert sky[2] - sky[0] > 40.0  # blue
    assert abs(ground[2] - ground[0]) < 20.0  # grey
    assert np.ptp(middle.mean(axis=1)) > 60.0  # the vehicle


@pytest.mark.long
@pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium")
def test_film_has_its_pictures_and_length(log):
    imageio = pytest.importorskip("imageio")
    span = ("--from", "1", "--to", "2", "--fps", "2", "--speed", "0.5")
    done = run(log.parent, log, "--out", "a.mp4", *SMALL, *span)
    assert done.returncode == 0, done.stderr
    film = imageio.get_reader(log.parent / "a.mp4")
    pictures = list(film.iter_data())
    assert [picture.shape for picture in pictures] == [(120, 160, 3)] * 5
    assert film.get_meta_data()["duration"] == pytest.approx(2.5, abs=0.05)
    sky = pictures[0][2, 80].astype(float)
    assert sky[2] - sky[0] > 40.0  # blue
    assert np.ptp(pictures[0][40:80, 60:100].mean(axis=2)) > 60.0  # the vehicle
    assert np.abs(pictures[0].astype(float) - pictures[-1]).mean() > 0.05  # which moves


@pytest.mark.parametrize("name", ["a.gif", "a.webp"])
def test_animation_has_its_pictures_and_length(tmp_path, name):
    from PIL import Image

    pictures = [Image.new("RGB", (160, 120), (60 * k, 90, 120)) for k in range(3)]
    write_film(tmp_path / name, name[1:], iter(pictures), Shot(rate=4.0, size=(160, 120)))
    film = Image.open(tmp_path / name)
    durations = []
    for k in range(film.n_frames):
        film.seek(k)
        film.load()
        durations.append(film.info["duration"])
    assert (film.size, durations) == ((160, 120), [250] * 3)


@pytest.mark.long
@pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium")
def test_interrupted_film_leaves_former_file(log, tmp_path):
    name = "c.mp4"
    (tmp_path / name).write_text("former film")
    words = [sys.executable, "-m", "lapwing", "render", str(log), "--out", name, *SMALL, "--fps", "120", "--speed", "1"]
    with subprocess.Popen(
        words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as command:
        while command.poll() is None and not list(tmp_path.glob(f".{name}*")):
            time.sleep(0.05)
        os.killpg(command.pid, signal.SIGINT)  # as a terminal does
        _, err = command.communicate()
    lines = [line for line in err.replace("\r", "\n").splitlines() if "pictures" not in line and line.strip()]
    assert (command.returncode, lines) == (130, ["lapwing: ended by SIGINT"])
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {name: "former film"}


@pytest.mark.long
@pytest.mark.skipif(headless.PROGRAM is None, reason="needs Chromium")
@pytest.mark.parametrize("name", ["b.gif", "b.webp"])
def test_command_writes_animation_of_moving_vehicle(log, name):
    from PIL import Image

    done = run(log.parent, log, "--out", name, *SMALL, "--from", "1", "--to", "2", "--fps", "2")
    assert done.returncode == 0, done.stderr
    film = Image.open(log.parent / name)
    pictures = []
    for k in range(film.n_frames):
        film.seek(k)
        pictures.append(np.asarray(film.convert("RGB"), float))
        assert film.info["duration"] == 500
    assert [picture.shape for picture in pictures] == [(120, 160, 3)] * 3
    assert pictures[0][2, 80, 2] - pictures[0][2, 80, 0] > 40.0  # blue sky
    assert np.ptp(pictures[0][40:80, 60:100].mean(axis=2)) > 60.0  # the vehicle
    assert np.abs(pictures[0] - pictures[-1]).mean() > 0.05  # which moves
