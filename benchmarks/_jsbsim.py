"""Quadrotor in JSBSim for benchmarks: the model `jsbsim_quad.xml` of its rigid body and control system."""

import tempfile
from pathlib import Path

import numpy as np

MODEL = Path(__file__).with_name("jsbsim_quad.xml")
CONTROL = 0.004  # [s] between two steps of the control channel
FOOT = 0.3048  # [m] in a foot
HEIGHT = 10.0  # [m] above the ground at the start
AXES = ("north", "east", "up")


class JsbsimQuad:
    """Vehicle that is loaded once and flown repeatedly from its start."""

    def __init__(self, step: float):
        """Create the aircraft with `step` [s], a divisor of the control interval; ImportError without JSBSim."""
        import jsbsim

        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder, MODEL.stem)
            place.mkdir()
            text = MODEL.read_text(encoding="utf-8")
            place.joinpath(MODEL.name).write_text(text.replace('execrate="4"', f'execrate="{round(CONTROL / step)}"'))
            jsbsim.FGJSBBase().debug_lvl = 0  # no banner
            self._fdm = fdm = jsbsim.FGFDMExec(folder, None)
            fdm.set_debug_level(0)
            fdm.set_aircraft_path(folder)
            fdm.set_dt(step)  # before loading: filters are built for this step
            fdm.load_model(MODEL.stem)
        fdm.disable_output()
        fdm["ic/lat-geod-deg"], fdm["ic/long-gc-deg"] = 45.0, 0.0
        fdm["ic/terrain-elevation-ft"], fdm["ic/h-agl-ft"] = 0.0, HEIGHT / FOOT
        fdm.run_ic()
        self._step = step

    def fly(self, seconds: float, target: tuple[float, float, float]) -> np.ndarray:
        """Return the position [m] after a flight towards a target [m]: north, east, up of the start, shape (3,)."""
        fdm, start = self._fdm, np.array([0.0, 0.0, HEIGHT])  # JSBSim counts "up" from the ground
        fdm.reset_to_initial_conditions(0)
        for axis, value in zip(AXES, start + target, strict=True):
            fdm[f"target/{axis}-m"] = value
        run = fdm.run
        for _ in range(round(seconds / self._step)):
            run()
        return FOOT * np.array([fdm[f"position/from-start-neu-{axis[0]}-ft"] for axis in AXES]) - start
