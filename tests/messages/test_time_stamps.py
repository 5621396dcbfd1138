import pytest

from lapwing.messages import header, nanoseconds, stamp, stamp_ns


@pytest.mark.parametrize("time_ns", [0, 1, 999_999_999, 1_000_000_000, 123_456_789_012_345])
def test_nanoseconds_round_trip(time_ns):
    assert nanoseconds(stamp(time_ns)) == time_ns
    assert stamp_ns(header(time_ns, "world")) == time_ns
    assert header(time_ns, "world").frame_id == "world"


def test_stamp_has_seconds_and_nanoseconds():
    assert stamp(1_500_000_000) == (1, 500_000_000)
