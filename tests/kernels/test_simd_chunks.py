"""Groups of four hold all members in their order, and give them back without the filling."""

import pytest

from lapwing.kernels import kernel
from lapwing.kernels.simd_chunks import in_fours, one_by_one


@kernel
def there_and_back(values):
    groups = in_fours(values, -1.0)
    return groups, one_by_one(groups, values)


@pytest.mark.parametrize("n", [1, 4, 6])
def test_there_and_back(n):
    values = tuple(float(i) for i in range(n))
    groups, back = there_and_back(values)
    assert back == values
    assert [member for group in groups for member in group] == [*values, *[-1.0] * (-n % 4)]
    assert (groups, back) == there_and_back.py_func(values)
