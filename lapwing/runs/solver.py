"""Integrator and step of scenes that only set an accuracy."""

from lapwing.cosim.scene import Scene
from lapwing.services.plant.schema import accuracy_to_select_for
from lapwing.services.scene_resolver import load


def with_solver(scene: Scene) -> Scene:
    """Return the scene with integrator and step that meet its accuracy; unchanged if it sets a step, or no accuracy.

    Raises:
        SceneError: no integrator meets the accuracy on this plant.
    """
    if accuracy_to_select_for(scene) is None:
        return scene
    from lapwing.studies.accuracy import solver_selection  # not needed for scenes that set a step

    return load(scene, solver_selection.overrides(scene, lambda _: None))
