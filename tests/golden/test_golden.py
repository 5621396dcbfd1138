"""Shipped scenes fly to their golden digests: some to the end, the others for their first second."""

import math

import pytest

from lapwing.messages import Point, Pose, VehicleState, header
from tests.cosim.memory_log import fly
from tests.golden import digests, thinned_log
from tests.golden.cases import CASES

WHOLE = {"gyrostat_blocked", "os4_motors", "cooperative_load", "hover"}
QUICK = {"gyrostat_blocked", "os4_motors", "hover"}


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in CASES])
def test_scene_flies_to_its_digest(name):
    golden, config = digests.read()[name], CASES[name].resolve()
    whole = name in WHOLE
    log = fly(config, last=None if whole else round(digests.BEGINNING * config.rate))
    if log.digest != (golden.digest if whole else golden.beginning):
        result = thinned_log.first_difference(thinned_log.read(digests.sample_file(name)), log, whole)
        pytest.fail("\n".join(["differs from the golden digest; run `python -m tests.golden`", *result]))


def test_every_golden_case_has_reason():
    known = digests.read()
    assert known.keys() == CASES.keys()
    for name, golden in known.items():
        assert golden.reason
        assert digests.sample_file(name).stat().st_size < 100_000


@pytest.fixture(scope="module")
def flown():
    return fly(CASES["os4_motors"].resolve(), last=300)


class Changed:
    """Flight with changed payloads: {(topic, number): payload}."""

    def __init__(self, flown, changes):
        self.config, self.topics, self._flown, self._changes = flown.config, flown.topics, flown, changes

    def payloads(self, name):
        return [(t, self._changes.get((name, i), p)) for i, (t, p) in enumerate(self._flown.payloads(name))]


def test_first_difference_has_field_and_size(flown, tmp_path):
    thinned_log.write(tmp_path / "sample.mcap", thinned_log.take(flown))
    kept = thinned_log.read(tmp_path / "sample.mcap")
    assert thinned_log.first_difference(kept, flown) == []
    truth = flown.messages("ground_truth")
    number = 8 * math.ceil(len(truth) / thinned_log.KEPT)  # a sampled message
    speed = tuple(w + 0.25 for w in truth[number].rotor_speed)
    later = {("ground_truth", i): m._replace(rotor_speed=speed).encode() for i, m in enumerate(truth) if i >= number}
    began, field = thinned_log.first_difference(kept, Changed(flown, later))
    before, at = (t * flown.config.interval for t in (number - 1, number + 1))
    assert began.startswith(f"/{flown.config.vehicle}/ground_truth: differs first, after t = ")
    after, until = (float(part.split(" s")[0]) for part in began.split("t = ")[1:])
    assert after <= before < until <= at
    old = truth[number].rotor_speed[0]
    assert f"rotor_speed.0 was {old!r}, is {old + 0.25!r}, by 0.25" in field


def test_beginning_of_flight_equals_sample(flown):
    kept = thinned_log.take(flown)
    short = fly(flown.config, last=217)
    assert thinned_log.first_difference(kept, short, whole=False) == []
    assert any("differs first" in line for line in thinned_log.first_difference(kept, short))


def test_change_between_sampled_messages_is_detected(flown):
    message = flown.messages("ground_truth")[151]._replace(air_density=7.0).encode()
    (began,) = thinned_log.first_difference(thinned_log.take(flown), Changed(flown, {("ground_truth", 151): message}))
    assert "ground_truth: differs first" in began


def test_added_and_removed_topics_are_named(flown):
    kept = thinned_log.take(flown)
    gone = {f"/{flown.config.vehicle}/more": kept[f"/{flown.config.vehicle}/ground_truth"], **kept}
    assert thinned_log.first_difference(gone, flown) == [f"/{flown.config.vehicle}/more: this topic is gone"]
    del kept["/tf"]
    assert thinned_log.first_difference(kept, flown) == ["/tf: this topic is new"]


def test_difference_is_that_of_same_vehicle():
    """A topic of a fleet has several messages of one time."""
    left, right, moved = (
        VehicleState(header(0, frame), Pose(Point(x, 0.0, 0.0))).encode()
        for frame, x in (("left", 1.0), ("right", 2.0), ("right", 3.0))
    )
    kept = thinned_log.TopicSample(1, [], [], [(0, VehicleState.type_name, right)])
    ((_, line),) = thinned_log._fields("/tf", kept, [(0, left), (0, moved)], math.inf)
    assert "pose.position.x was 2.0, is 3.0, by 1" in line
