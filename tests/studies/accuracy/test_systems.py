"""Systems of the study: agreement of reference and integrators, and conservation of the invariants."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.studies.accuracy.coordinates import error, matrices, of_state
from lapwing.studies.accuracy.reference import attitude_rate
from lapwing.studies.accuracy.systems import free_rigid_body, problems
from lapwing.studies.accuracy.work_precision import drift
from tests.combinations import rest_nightly

pytestmark = pytest.mark.long


SYSTEMS = [name for name, p in problems().items() if any(m.name == "rkmk54" for m in p.methods)]


@pytest.mark.parametrize("name", rest_nightly(*SYSTEMS, keep=3))
def test_integrator_agrees_with_reference(name):
    problem = problems()[name]
    method = next(m for m in problem.methods if m.name == "rkmk54")
    coarse, fine = (method.read(t, method.prepare(t)()) for t in (1e-5, 1e-12))
    exact = problem.reference()
    assert error(fine.samples[-1], exact) < 3e-9
    assert error(coarse.samples[-1], exact) > 3 * error(fine.samples[-1], exact)
    assert max(drift(problem, fine).values()) < 1e-9


def test_wrong_motion_has_drift():
    problem = problems()["free_rigid_body"]
    method = next(m for m in problem.methods if m.name == "rkmk54")
    outcome = method.read(1e-8, method.prepare(1e-8)())
    outcome.samples[-1, 9:12] *= 1.01
    result = drift(problem, outcome)
    assert result["energy"] == pytest.approx(0.0201, rel=1e-3)
    assert result["momentum"] > 5e-3


@pytest.mark.parametrize("t", [0.3, 7.0, 25.0])
def test_closed_form_solves_eulers_equations(t):
    inertia, start = free_rigid_body.INERTIA, free_rigid_body.START

    def rate(_, y):
        o = y[9:]
        return np.concatenate([attitude_rate(y[:9], o), np.cross(inertia * o, o) / inertia])

    other = solve_ivp(rate, (0.0, t), of_state(start), method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert free_rigid_body.closed_form(inertia, start, t) == pytest.approx(other, abs=1e-10)


def test_matrices_equal_those_of_library():
    q = np.array([[0.5, -0.5, 0.5, 0.5], [0.8, 0.0, 0.6, 0.0]])
    assert matrices(q)[0] == pytest.approx([0, -1, 0, 0, 0, 1, -1, 0, 0], abs=1e-15)
    assert matrices(q)[1] == pytest.approx([0.28, 0, 0.96, 0, 1, 0, -0.96, 0, 0.28], abs=1e-15)
