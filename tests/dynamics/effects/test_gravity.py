from lapwing.dynamics.effects.gravity import Gravity, gravity


def test_weight(situation, rotors):
    force, torque = gravity.py_func(Gravity(9.81), (), situation(turn=(0.4, 0, 0)), rotors())
    assert force == (0.0, 0.0, -9.81 * 10.0224)
    assert torque == (0.0, 0.0, 0.0)
