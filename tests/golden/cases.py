"""Flights with golden digests: every shipped scene, and a plan."""

from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.services.common.plans import plan_file as plan
from lapwing.services.scene_resolver import load, resolve

SCENES = Path(__file__).parents[2] / "lapwing/scenes"


class Case(NamedTuple):
    """One flight."""

    scene: Path
    overrides: tuple[str, ...] = ()
    plan: Path | None = None

    def resolve(self) -> RunConfig:
        """Return the run configuration of the flight."""
        scene = load(self.scene, list(self.overrides))
        if self.plan is None:
            return resolve(scene)
        commands = plan.read(self.plan, plan.site_of(scene)).commands
        return resolve(scene, {scene.lookup("vehicle.name"): commands})


FOREIGN = ("ardupilot_quad", "betaflight_quad", "px4_quad")  # flown by a firmware that is not in the repository
OVERRIDES = {"groundstation": ("run.duration=5.0",)}  # for scenes without an end
CASES = {path.stem: Case(path, OVERRIDES.get(path.stem, ())) for path in sorted(SCENES.glob("*.toml"))}
CASES = {name: case for name, case in CASES.items() if name not in FOREIGN}
CASES["delivery.plan"] = Case(SCENES / "groundstation.toml", tuple(plan.OPERATED), SCENES / "plans" / "delivery.plan")
