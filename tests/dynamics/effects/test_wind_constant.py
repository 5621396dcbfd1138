from dynamics.effects.wind_constant import WindConstant, wind_constant


def test_adds_to_the_wind(situation):
    s = situation(wind=(1, 0, 0), density=1.1)
    assert wind_constant.py_func(WindConstant((2.0, -1.0, 0.5)), (), s, s.air) == (1.1, (3.0, -1.0, 0.5))
