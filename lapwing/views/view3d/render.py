"""Images and videos of the 3D view, rendered by a headless browser."""

import base64
import io
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.output_lock import write_errors
from lapwing.flights.flight_data import FlightData
from lapwing.views.view3d import require
from lapwing.views.view3d.headless import Browser

FORMATS = (".mp4", ".webp", ".gif", ".png")
QUALITY = 80  # quality of WebP, 0 to 100
JPEG = 0.95  # quality of the images from the browser, 0 to 1
BATCH = 16  # images per call of the browser
CAMERAS = ("follow", "orbit", "top", "onboard")
SMALLEST, LARGEST = 64, 3840  # [pixel] limits of width and height
START = """
const until = async (holds) => {
  for (let k = 0; k < 2400 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
  if (!holds()) throw new Error(`never: ${holds}`);
};
await until(() => window.lapwingView?.ready);
"""


class Shot(NamedTuple):
    """Settings of a video from `start` to `stop`, or of an image at `start`."""

    start: float | None = None  # [s] None: start of the flight; for an image its middle
    stop: float | None = None  # [s] None: end of the flight
    rate: float = 20.0  # [1/s] frame rate of the video
    speed: float = 1.0  # simulation time over video time
    camera: str = "follow"
    size: tuple[int, int] = (960, 540)  # [pixel]
    place: tuple[float, float, float] | None = None  # camera relative to the vehicle, over its size; None: `camera`


def check(target: Path, shot: Shot) -> None:
    """Raise ValueError for an unknown format or camera, and for numbers out of range."""
    if target.suffix not in FORMATS:
        raise ValueError(f"--out {target}: expected a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
    if target.suffix == ".mp4":
        _check_encoder(target)
    if shot.camera not in CAMERAS:
        raise ValueError(f"--camera {shot.camera}: expected {', '.join(CAMERAS[:-1])} or {CAMERAS[-1]}")
    if not all(SMALLEST <= side <= LARGEST and side % 2 == 0 for side in shot.size):
        limits = f"even numbers from {SMALLEST} to {LARGEST}"
        raise ValueError(f"--size {shot.size[0]}x{shot.size[1]}: expected {limits}, e.g. 1280x720")
    for option, number, largest in (("--fps", shot.rate, 120), ("--speed", shot.speed, 1000)):
        if not 0.0 < number <= largest:
            raise ValueError(f"{option} {number:g}: expected a number above 0, at most {largest}")


def _check_encoder(target: Path) -> None:
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise ValueError(
            f"--out {target}: needs the encoder of imageio-ffmpeg; pip install lapwing[view3d], or write .webp"
        ) from None


def render(
    flights: Sequence[FlightData],
    names: Sequence[str],
    target: Path,
    shot: Shot,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write an image or a video of flights; return its path.

    Args:
        flights: one flight, or several to compare; all but the first are translucent.
        names: display names of the flights.
        target: path with the extension .png, .gif, .webp or .mp4.
        shot: times, camera and size.
        progress: called with the number of finished images and the total.

    Raises:
        ValueError: the browser or viser is missing, a time is outside the flight, or the file cannot be written.
    """
    require()
    check(target, shot)
    from lapwing.views.view3d.recording import page

    times = _times(flights[0], target, shot)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "view.html"
        shown = times if len(times) > 1 else times + np.array([0.0, 1.0])  # the player needs a duration
        path.write_text(page(flights, names, shown), encoding="utf-8")
        address = path.resolve().as_uri() + ("" if target.suffix == ".mp4" else "#smooth")
        with Browser(address, size=shot.size) as browser:
            browser.run(f"{START} lapwingView.look({shot.camera!r}, 0, {_list(shot.place)});")
            pictures = _pictures(browser, times, target.suffix == ".png", progress)
            with write_errors(target), complete_file(target) as file:
                write_film(file, target.suffix, pictures, shot)
    return target


def _times(flight: FlightData, target: Path, shot: Shot) -> np.ndarray:
    first, last = (float(flight.truth.times[k]) for k in (0, -1))
    start = shot.start if shot.start is not None else 0.5 * (first + last) if target.suffix == ".png" else first
    stop = last if shot.stop is None else shot.stop
    if not first <= start <= stop <= last + 1e-9:
        raise ValueError(f"--from {start:g} --to {stop:g}: expected times of the flight, {first:g} to {last:g} s")
    if target.suffix == ".png":
        return np.array([start])
    return start + shot.speed / shot.rate * np.arange(max(1, int((stop - start) / shot.speed * shot.rate) + 1))


def _pictures(browser: Browser, times: np.ndarray, lossless: bool, progress: Any) -> Iterator[Any]:
    from PIL import Image

    kind, quality = ("png", 1.0) if lossless else ("jpeg", JPEG)
    for k in range(0, len(times), BATCH):
        batch = times[k : k + BATCH].tolist()
        for address in browser.run(f"return lapwingView.film({batch}, 'image/{kind}', {quality});"):
            picture = Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))).convert("RGB")
            yield picture
        progress(k + len(batch), len(times))


def write_film(file: Path, suffix: str, pictures: Iterator[Any], shot: Shot) -> None:
    """Write PIL images as a video in the format of `suffix`, or the first one as an image."""
    if suffix == ".mp4":
        _encode(file, pictures, shot)
        return
    first, kind = next(pictures), suffix[1:]
    if kind == "png":
        first.save(file, kind)
        return
    timing = {"save_all": True, "duration": round(1000.0 / shot.rate), "loop": 0}
    if kind == "webp":
        first.save(file, kind, append_images=pictures, quality=QUALITY, method=3, **timing)
        return
    rest = (picture.quantize(128, dither=0) for picture in pictures)  # each with an individual palette
    first.quantize(128, dither=0).save(file, kind, append_images=rest, **timing)


def _encode(file: Path, pictures: Iterator[Any], shot: Shot) -> None:
    import imageio_ffmpeg

    output = ["-preset", "veryfast", "-f", "mp4"]
    options = {"quality": 7, "macro_block_size": 2, "ffmpeg_log_level": "error", "output_params": output}
    writer = imageio_ffmpeg.write_frames(str(file), shot.size, fps=shot.rate, **options)
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    except BaseException as fault:
        writer.throw(fault)  # an interrupt kills the encoder
    writer.close()


def _list(place: tuple[float, float, float] | None) -> str:
    return "null" if place is None else str(list(place))
