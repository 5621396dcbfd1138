from lapwing.services.trajectory.segments import KINDS


def test_step_takes_no_time_and_ends_at_its_value():
    step = KINDS["step"](to=2.0)
    assert step.pieces(0.0) == []
    assert step.end(0.0) == 2.0
