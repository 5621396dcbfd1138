"""Small pictures of pages, light, dark and on a phone, for the repository: python -m tests.studies.page_looks."""

import io
import sys
import tempfile
from pathlib import Path

import numpy as np
import synthetic_flights
from PIL import Image

from lapwing.views.report import write
from lapwing.views.view3d.headless import Browser

REFERENCES = Path(__file__).parent / "page_looks"
WINDOWS = {"light": (1280, 900), "dark": (1280, 900), "phone": (390, 844)}  # size of the window [pixel]
SMALL = 16  # downsampling factor: text becomes grey, positions and colours remain
TICKS, RATE = 400, 100
MOTORS = ("rotor_speed", "motor_voltage", "motor_current", "motor_power", "rotor_thrust", "rotor_torque")
DRAWN = """
for (let k = 0; k < 6000; k++) {
  const plots = [...document.querySelectorAll("figure.plot")];
  const near = plots.filter((one) => one.checkVisibility() && one.getBoundingClientRect().top < innerHeight);
  if (document.readyState === "complete" && near.length && near.every((one) => one.querySelector(".main-svg"))) break;
  await new Promise((done) => setTimeout(done, 50));
}
await new Promise((done) => setTimeout(done, 300));
return [document.documentElement.scrollWidth, innerWidth];
"""


def flight():
    """Return a flight of 4 s around a corner, with a setpoint."""
    t = np.arange(TICKS) / RATE
    place = np.column_stack([np.minimum(t, 2.0), np.maximum(t - 2.0, 0.0), 1.0 + 0.0 * t])
    truth = {
        "pose.position": place,
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": (1.0, 0.0, 0.0),
        "acceleration": (0.0,) * 3,
        "wind": (0.0,) * 3,
        **dict.fromkeys(MOTORS, (1.0,) * 4),
        "air_density": 1.2,
        "ground_contact": np.zeros(TICKS, bool),
    }
    result = synthetic_flights.flight(TICKS, RATE, scene={"vehicle": {"model": "rigid_body"}}, ground_truth=truth)
    result.digest = "0" * 32
    return result


def pictures():
    """Yield each look, its picture in few pixels, shape (rows, columns, 3), and widths of page and window."""
    with tempfile.TemporaryDirectory() as folder:
        page = write(flight(), Path(folder, "flight.html"))
        for look, size in WINDOWS.items():
            with Browser("data:text/html,empty", size=size) as browser:
                scheme = {"name": "prefers-color-scheme", "value": "dark" if look == "dark" else "light"}
                browser.call("Emulation.setEmulatedMedia", features=[scheme])
                browser.call("Page.navigate", url=page.resolve().as_uri())
                widths = browser.run(DRAWN)
                image = Image.open(io.BytesIO(browser.picture())).convert("RGB")
            yield look, np.asarray(image.resize((size[0] // SMALL, size[1] // SMALL), Image.Resampling.BOX)), widths


def reference_picture(look):
    """Return the reference picture, shape (rows, columns, 3)."""
    return np.asarray(Image.open(REFERENCES / f"{look}.png").convert("RGB"))


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    REFERENCES.mkdir(exist_ok=True)
    for name, pixels, _ in pictures():
        Image.fromarray(pixels).save(REFERENCES / f"{name}.png")
