"""Groups of four hold all members in their order, and give them back without the filling."""

import pytest

from lapwing.kernels import kernel
from lapwing.kernels.simd_chunks import chunk4, unchunk4


@kernel
def there_and_back(values):
    groups = chunk4(values, -1.0)
    return groups, unchunk4(groups, values)


@pytest.mark.parametrize("n", [1, 4, 6])
def test_there_and_back(n):
    values = tuple(float(i) for i in range(n))
    groups, back = there_and_back(values)
    assert back == values
    assert [member for group in groups for member in group] == [*values, *[-1.0] * (-n % 4)]
    assert (groups, back) == there_and_back.py_func(values)
