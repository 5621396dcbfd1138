"""Flights with a commander called only at wake-ups: bit-for-bit those with a call at every tick."""

import pytest
from flights import ENABLED, NAN, RATE, SCENE, command, inject, item

from lapwing.services.autopilot.commander_block import CommanderBlock
from lapwing.services.common.failure_types import GARBAGE, OFF, SOUND, STUCK, WRONG
from lapwing.services.scene_resolver import load, resolve
from tests.combinations import NIGHTLY
from tests.cosim import memory_log

pytestmark = pytest.mark.long

MISSION, GROUND = "delivery_mission", "groundstation"
OPERATOR = "autopilot.accept_commands=true"
SOON = [f"autopilot.parameters.{name}" for name in ("COM_POS_FS_DELAY=0.5", "RTL_RETURN_ALT=3.0", "COM_DL_LOSS_T=1.0")]
FENCE = [item("fence_circle_in", 0.0, 0.0, radius=1.0)]
ITEMS = [item("takeoff", z=3.0), item("waypoint", 2.0, 0.0, 3.0), item("return")]
LINK = {(0.5, 5.0): [command("link")]}
SETPOINTS = {(3.0, 5.0): [command("offboard_position", 0.0, 0.0, 2.0, NAN)]}
STICKS = {(3.0, 6.0): [command("manual", 0.4, 0.0, 0.1, 0.0)]}
GPS_LOST = 'sensors.gps.faults=[{kind="dropout", start=3.013, stop=5.5}]'
DAMAGE = [
    "effects.rotor_damage.rotor=2", "effects.rotor_damage.time=4.0", "effects.rotor_damage.remaining_thrust=0.55",
    "effects.rotor_damage.remaining_torque=0.55",
]  # fmt: skip
BATTERY = ["effects.battery.initial_charge=0.1502"]
SHORT = [
    'trajectory.phase=[{name="wait", duration=1.0}, {name="climb", z={kind="ramp", to=1.0, rate=1.0}},'
    ' {name="descend", z={kind="ramp", to=0.0, rate=1.0}}, {name="land", duration=2.0}]'
]

CASES = {
    "no commands": (MISSION, 4.0, {}, [OPERATOR]),
    "from the ground to the ground": (MISSION, 12.0, {}, [OPERATOR, *SHORT]),
    "commands after the landing": (MISSION, 9.0, {7.5: [command("hold")], 8.2: [command("arm")]}, [OPERATOR, *SHORT]),
    "answers once a second": (MISSION, 4.0, LINK, [OPERATOR, "rates.commands=1"]),
    "answers at other ticks than looks": (MISSION, 7.0, LINK, [OPERATOR, "rates.commands=125", *SOON]),
    "the link is lost": (MISSION, 8.0, LINK, [OPERATOR, *SOON, "autopilot.parameters.NAV_DLL_ACT=2"]),
    "a fence is left": (MISSION, 17.0, {14.0: [command("fence_upload", items=FENCE)]}, [OPERATOR]),
    "goto and back by hand": (MISSION, 8.0, {4.0: [command("goto", 1.0, 0.0, 3.0)], 6.0: [command("return")]},
                              [OPERATOR]),
    "a mission by command": (MISSION, 12.0, {3.0: [command("mission_upload", items=ITEMS)], 5.0: [command("mission")]},
                             [OPERATOR, *SOON]),
    "a mission before the take-off": (MISSION, 6.0, {0.5: [command("mission_upload", items=ITEMS)]}, [OPERATOR]),
    "setpoints that stop": (MISSION, 7.0, SETPOINTS, [OPERATOR]),
    "offboard, and setpoints that stop": (MISSION, 7.0, SETPOINTS | {4.0: [command("offboard")]}, [OPERATOR]),
    "sticks": (MISSION, 8.0, STICKS | {4.0: [command("position_control")]}, [OPERATOR]),
    "disarmed in the air": (MISSION, 6.0, {4.0: [command("disarm", 1.0)]}, [OPERATOR]),
    "another parameter": (MISSION, 6.0, {3.0: [command("parameter", 5.0, text="PID_Z_P")]}, [OPERATOR]),
    "the GPS is injured": (MISSION, 9.0, {3.0: [inject("gps", OFF)], 7.0: [inject("gps", SOUND)]},
                           [OPERATOR, ENABLED, *SOON]),
    "the IMU is injured": (MISSION, 6.0, {3.0: [inject("gyro", STUCK)]}, [OPERATOR, ENABLED, *SOON]),
    "the barometer tells garbage": (MISSION, 6.0, {3.0: [inject("barometer", GARBAGE)]}, [OPERATOR, ENABLED]),
    "the battery is injured": (MISSION, 8.0, {3.0: [inject("battery", WRONG)]},
                               [OPERATOR, ENABLED, "effects.battery={}"]),
    "a motor is injured": (MISSION, 6.0, {4.0: [inject("motor", OFF, 2)]}, [OPERATOR, ENABLED]),
    "an emptying battery": (MISSION, 10.0, {}, [OPERATOR, *BATTERY]),
    "a lost position": (MISSION, 9.0, {}, [OPERATOR, *SOON, GPS_LOST]),
    "a damaged rotor": (SCENE, 8.0, {}, [OPERATOR, *DAMAGE]),
    "on the truth": (SCENE, 4.0, LINK, [OPERATOR, *SOON]),
    "no link, a damaged rotor": (SCENE, 8.0, {}, DAMAGE),
    "no link, a lost position": (MISSION, 9.0, {}, [*SOON, GPS_LOST]),
    "no link, an emptying battery": (MISSION, 10.0, {}, BATTERY),
    "no trajectory": (GROUND, 6.0, {0.04: [command("takeoff", 2.0), command("arm", NAN, 10.0)]}, []),
}  # fmt: skip
EVERY_DAY = {
    "no commands", "from the ground to the ground", "answers at other ticks than looks", "the link is lost",
    "a fence is left", "a mission by command", "offboard, and setpoints that stop", "sticks", "the GPS is injured",
    "on the truth", "no trajectory",
}  # fmt: skip
ROUNDS = {"no commands": 4.0 * RATE / 5 + 1}
"""Count the commander steps in these flights."""


def operator_of(script, answers_every):
    """Return the commands of a script at the first tick at which they are accepted."""

    def operator(tick):
        result = []
        for when, commands in script.items():
            start, end = when if isinstance(when, tuple) else (when, when)
            ticks = range(round(start * RATE), round(end * RATE) + 1, 25)
            result += [c for t in ticks if 0 <= tick - t < answers_every for c in commands]
        return result

    return operator


def fly_counted(name, monkeypatch, always):
    """Return the flight and the number of commander steps."""
    scene, seconds, script, overrides = CASES[name]
    config = resolve(load(scene, [*overrides, f"run.duration={seconds}"]))
    requested = []

    def on_tick(self, tick, act=CommanderBlock.on_tick):
        requested.append(tick)
        following = act(self, tick)
        return tick + 1 if always else following

    with monkeypatch.context() as patch:
        patch.setattr(CommanderBlock, "on_tick", on_tick)
        log = memory_log.fly(config, operator_of(script, config.services["autopilot"].parameters.answers_every))
    return log, len(requested)


@pytest.mark.parametrize("name", [n if n in EVERY_DAY else pytest.param(n, marks=NIGHTLY) for n in CASES])
def test_sparse_commander_equals_commander_every_tick(name, monkeypatch):
    always, most = fly_counted(name, monkeypatch, always=True)
    seldom, requested = fly_counted(name, monkeypatch, always=False)
    assert requested < most or name == "no trajectory"
    assert requested == ROUNDS.get(name, requested)
    assert seldom.topics.keys() == always.topics.keys()
    for topic in always.topics:
        assert seldom.payloads(topic) == always.payloads(topic), topic
    assert seldom.digest == always.digest
