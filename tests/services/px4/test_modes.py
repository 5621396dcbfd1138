"""Failsafe events of PX4: ids of PX4's generated metadata (all_events.json, May 2026), texts."""

import struct

import pytest

from lapwing.services.common.firmware.status_texts import ACTIVATED, StatusTexts
from lapwing.services.px4.modes import event_id, failsafe_text

NUMBERS = {
    "commander_failsafe_enter": 9751178,
    "commander_failsafe_enter_generic": 14605264,
    "commander_failsafe_enter_hold": 13704694,
    "commander_failsafe_enter_generic_hold": 4502496,
    "commander_failsafe_enter_autopilot_disengaged": 12770418,
    "commander_failsafe_enter_generic_warn": 13277401,
    "commander_failsafe_enter_warn": 8557551,
    "commander_failsafe_enter_low_bat": 12216659,
    "commander_failsafe_enter_crit_bat_warn": 2474944,
    "commander_failsafe_enter_crit_low_bat_warn": 51327,
    "commander_failsafe_enter_low_flight_time_warn": 2308551,
}


@pytest.mark.parametrize("name", NUMBERS)
def test_event_id_equals_metadata(name):
    assert event_id(name) == (1 << 24) + NUMBERS[name]


@pytest.mark.parametrize(
    ("name", "arguments", "text"),
    [
        ("commander_failsafe_enter", struct.pack("<IBB", 4, 6, 3), "low battery: return"),
        ("commander_failsafe_enter_hold", struct.pack("<IBHB", 4, 6, 5, 4), "critical battery: return in 5 s"),
        ("commander_failsafe_enter_generic", struct.pack("<IB", 4, 8), "descend"),
        ("commander_failsafe_enter_generic_hold", struct.pack("<IBH", 4, 7, 2), "land in 2 s"),
        ("commander_failsafe_enter", struct.pack("<IBB", 4, 99, 98), "98: 99"),  # of a later version
        ("commander_failsafe_enter_low_flight_time_warn", b"", ""),
    ],
)
def test_text_has_cause_and_action(name, arguments, text):
    assert failsafe_text(event_id(name), arguments.ljust(40, b"\0")) == text


def test_other_events_have_no_text():
    assert failsafe_text((1 << 24) + 961599, bytes(40)) is None


def test_warning_is_no_failsafe():
    """PX4 sends the same status text, before or after the event, for warnings and failsafes."""
    early, late, both = StatusTexts(), StatusTexts(), StatusTexts()
    early.add(ACTIVATED, 2, armed=True, is_arming=False)
    early.add_event("")
    late.add_event("")
    late.add(ACTIVATED, 2, armed=True, is_arming=False)
    both.add_event("low battery: return")
    both.add_event("")
    assert (early.failsafe, late.failsafe, both.failsafe) == ("", "", "low battery: return")
