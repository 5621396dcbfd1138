"""Numbers of the state message: exact digits, independent of the C library."""

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lapwing.kernels import kernel
from lapwing.services.ardupilot.state_message import LIMIT, write_number


@kernel
def write(out, value, decimals):
    return write_number(out, 0, value, decimals)


def text(value, decimals=9):
    out = np.zeros(40, np.uint8)
    return out[: write(out, value, decimals)].tobytes().decode()


@pytest.mark.parametrize(
    ("value", "result"),
    [
        (0.0, "0"), (-0.0, "0"), (1.0, "1"), (-1.0, "-1"), (0.5, "0.5"), (-9.80665, "-9.80665"), (10.0, "10"),
        (100.25, "100.25"), (0.000000001, "0.000000001"), (-0.0000000004, "0"), (0.9999999996, "1"),
        (899999999.5, "899999999.5"), (1234.5, "1234.5"),
    ],
)  # fmt: skip
def test_number_has_no_trailing_zeros(value, result):
    assert text(value) == result


def test_time_has_ten_decimals():
    assert text(12.3456789012, 10) == "12.3456789012"
    assert text(7.0, 0) == "7"


@given(st.floats(-LIMIT, LIMIT, exclude_min=True, exclude_max=True))
def test_number_is_rounded_to_nine_decimals(value):
    result = text(value)
    assert "e" not in result
    assert " " not in result
    error = abs(Decimal(result) - Decimal(value))
    assert error <= Decimal("0.5000001e-9") + Decimal(abs(value)) * Decimal(2) ** -52
