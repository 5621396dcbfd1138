"""One and five bodies against the conserved momentum: five converge, reduced models keep their model error."""

import pytest

from lapwing.studies.accuracy.coordinates import error
from lapwing.studies.accuracy.systems.delivery_drone import problems

pytestmark = pytest.mark.long

STEP = 2.0 / 2048


@pytest.fixture(scope="module")
def results():
    problem = problems()["delivery_drone"]
    exact = problem.reference()
    outcomes = {
        method.name: [method.read(h, method.prepare(h)()) for h in (2 * STEP, STEP)] for method in problem.methods
    }
    return {name: [(error(o.samples[-1], exact), o.defect) for o in two] for name, two in outcomes.items()}


def test_five_bodies_converge_in_every_description(results):
    for name, ((coarse, _), (fine, _)) in results.items():
        if not name.startswith("reduced"):
            assert fine < 2e-5, name
            assert coarse > 6.0 * fine, name


def test_both_coordinates_agree(results):
    for stabilisation in ("partitioning", "projection"):
        for coordinates in ("SE(3)", "Euler"):
            assert results[f"{coordinates}, {stabilisation}"][1][1] < 1e-10


def test_hinges_drift_without_stabilisation(results):
    assert results["SE(3), none"][1][1] > 1e2 * results["SE(3), projection"][1][1]


def test_reduced_model_keeps_its_model_error(results):
    """The error is about 0.6 %, the share of the blades, parallel to x at the start (theory, eq. (8.51))."""
    for name in ("reduced, frame only", "reduced, mean"):
        (coarse, _), (fine, _) = results[name]
        assert fine == pytest.approx(coarse, rel=1e-3)
        assert 1e-3 < fine < 2e-2
