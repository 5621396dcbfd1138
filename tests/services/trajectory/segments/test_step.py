from lapwing.services.trajectory.segments import KINDS


def test_step_has_no_duration():
    step = KINDS["step"](to=2.0)
    assert step.pieces(0.0) == []
    assert step.end(0.0) == 2.0
