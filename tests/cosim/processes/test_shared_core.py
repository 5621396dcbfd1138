"""Core that a thread shares with a program: choice, other runs, foreign load, end."""

import os
import subprocess
import sys
import threading

import pytest

from lapwing.cosim.processes import shared_core
from lapwing.cosim.processes.shared_core import SharedCore, claim_core, cores_at_start, less_loaded_core, process_tree

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="affinity of threads exists on Linux only")
two_cores = pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one core only"
)
NOBODY = 10_000  # number of a core that no machine of the tests has


def in_thread(function):
    """Return the result of a function that may change the affinity of its thread."""
    result = []
    thread = threading.Thread(target=lambda: result.append(function()))
    thread.start()
    thread.join()
    return result[0]


@pytest.fixture
def program():
    """Program with a child process of its own; both wait."""
    code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'input()'], check=False)"
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE)
    while len(process_tree(process.pid)) < 2:
        assert process.poll() is None
    yield process.pid
    process.communicate(b"\n")


def masks(pid):
    return [os.sched_getaffinity(each) for each in process_tree(pid)]


@two_cores
def test_program_shares_core_with_thread_until_end(program):
    allowed = os.sched_getaffinity(0)

    def share():
        core = SharedCore()
        core.begin(program, allowed)
        inside = os.sched_getaffinity(0), masks(program)
        core.end()
        return inside, os.sched_getaffinity(0)

    (own, theirs), after = in_thread(share)
    assert len(own) == 1
    assert own < allowed
    assert theirs == [own, own]
    assert after == allowed
    assert os.sched_getaffinity(0) == allowed  # of this thread, which continued


@two_cores
def test_thread_with_single_core_does_not_pin_program(program):
    last = max(os.sched_getaffinity(0))

    def share():
        os.sched_setaffinity(0, {last})
        core = SharedCore()
        core.begin(program, {last})  # its cores are others, as after `taskset -p`
        inside = os.sched_getaffinity(0)
        core.end()
        return inside, masks(program), os.sched_getaffinity(0)

    own, theirs, after = in_thread(share)
    assert own == after == {last}
    assert {last} not in theirs


@two_cores
def test_program_follows_thread_pinned_later(program):
    last = max(os.sched_getaffinity(0))

    def share():
        allowed = os.sched_getaffinity(0)
        core = SharedCore()
        os.sched_setaffinity(0, {last})  # by the executor of a service
        core.begin(program, allowed)
        core.end()
        return masks(program), os.sched_getaffinity(0)

    theirs, after = in_thread(share)
    assert theirs == [{last}, {last}]
    assert after == {last}


@two_cores
@pytest.mark.parametrize("core", [min, max])
def test_program_in_turns_shares_core_and_stays_there(core, program, monkeypatch):
    monkeypatch.setattr(shared_core, "PERIOD", 0.0)
    monkeypatch.setattr(shared_core, "less_loaded_core", lambda core, own, loads: min(set(loads) - {core}))
    first = {core(os.sched_getaffinity(0))}
    for each in process_tree(program):
        os.sched_setaffinity(each, first)

    def share():
        core = SharedCore()
        core.begin(program, first)
        before = os.sched_getaffinity(0)
        core.update()  # on two cores, messages could change their order while it moves
        inside = before, os.sched_getaffinity(0), *masks(program)
        core.end()
        return inside

    own, *others = in_thread(share)
    assert len(own) == 1
    assert others == [own, own, own]


def test_program_in_turns_starts_on_one_of_allowed_cores():
    allowed = os.sched_getaffinity(0)
    assert set(cores_at_start(in_turns=False)) == allowed
    (core,) = cores_at_start(in_turns=True)
    assert core in allowed


@two_cores
def test_program_with_affinity_of_its_own_is_left_alone(program):
    allowed, first = os.sched_getaffinity(0), min(os.sched_getaffinity(0))
    os.sched_setaffinity(program, {first})

    def share():
        core = SharedCore()
        core.begin(program, allowed)
        return os.sched_getaffinity(0)

    assert in_thread(share) == allowed
    assert masks(program)[0] == {first}


@two_cores
def test_change_from_outside_ends_sharing(program, monkeypatch):
    monkeypatch.setattr(shared_core, "PERIOD", 0.0)
    allowed = os.sched_getaffinity(0)

    def share():
        core = SharedCore()
        core.begin(program, allowed)
        os.sched_setaffinity(0, allowed)  # as `taskset -p` does
        core.update()
        core.end()
        return os.sched_getaffinity(0)

    assert in_thread(share) == allowed


@two_cores
def test_pair_leaves_core_with_other_load(program, monkeypatch):
    monkeypatch.setattr(shared_core, "PERIOD", 0.0)
    chosen = []

    def leave(core, own, loads):
        chosen.append(min(set(loads) - {core}))
        return chosen[0]

    monkeypatch.setattr(shared_core, "less_loaded_core", leave)

    def share():
        core = SharedCore()
        core.begin(program, os.sched_getaffinity(0))
        core.update()
        inside = os.sched_getaffinity(0), masks(program)
        core.end()
        return inside

    own, theirs = in_thread(share)
    assert own == {chosen[0]}
    assert theirs == [own, own]


def test_claims_differ_until_every_core_is_claimed():
    cores = [NOBODY, NOBODY + 1, NOBODY + 2]
    claims = [claim_core(cores) for _ in range(7)]
    assert [claim.core for claim in claims] == [*cores, *cores, cores[0]]
    claims[1].release()
    assert claim_core(cores).core == cores[1]
    for claim in claims:
        claim.release()


def test_only_cores_in_affinity_mask_are_claimed(monkeypatch):
    mask = {NOBODY + 20, NOBODY + 25}
    monkeypatch.setattr(shared_core, "_affinity", lambda thread: mask)
    claims = [shared_core.claim_any() for _ in range(2)]
    assert {claim.core for claim in claims} == mask
    for claim in claims:
        claim.release()


def test_claim_of_another_run_counts_until_its_end():
    cores = [NOBODY + 10, NOBODY + 11]
    code = f"""
from lapwing.cosim.processes.shared_core import claim_core
claim = claim_core({cores})
print(claim.core, flush=True)
input()
"""
    other = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert int(other.stdout.readline()) == cores[0]
    claim = claim_core(cores)
    assert claim.core == cores[1]
    claim.release()
    other.kill()
    other.communicate()
    claim = claim_core(cores)
    assert claim.core == cores[0]
    claim.release()


@pytest.mark.parametrize(
    ("own", "loads", "expected"),
    [
        (0.9, {0: 1.0, 1: 0.0}, None),  # the pair alone
        (0.5, {0: 1.0, 1: 0.0, 2: 0.1}, 1),  # half of the core is used by others
        (0.5, {0: 1.0, 1: 0.4}, None),  # not much better
        (0.5, {0: 1.0, 1: 1.0}, None),  # all are busy
        (0.2, {0: 1.0}, None),  # no other core
    ],
)
def test_thread_moves_only_to_clearly_less_loaded_core(own, loads, expected):
    assert less_loaded_core(0, own, loads) == expected


def test_busy_times_grow_by_elapsed_time_at_most():
    before = shared_core.busy_times()
    assert before.keys() >= os.sched_getaffinity(0)
    assert all(shared_core.busy_times()[core] >= time for core, time in before.items())
