"""Selection of MAVLink frames from a stream that arrives in any pieces and contains garbage."""

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from lapwing.services.common.firmware.frame_filter import FrameFilter
from lapwing.services.common.firmware.mission_client import NEEDED, MissionClient

MESSAGES = (
    mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 4, 3),
    mavlink.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
    mavlink.MAVLink_statustext_message(3, b"a text"),
    mavlink.MAVLink_highres_imu_message(*(1,) * 15),
    mavlink.MAVLink_command_ack_message(400, 0),
)


def packed(message, version):
    codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    return message.pack(codec, force_mavlink1=version == 1)


@given(st.lists(st.tuples(st.sampled_from(MESSAGES), st.sampled_from([1, 2]))), st.integers(1, 40))
def test_filter_passes_needed_frames_in_any_pieces(sent, size):
    stream = b"".join(packed(*one) for one in sent)
    frames = FrameFilter(NEEDED)
    passed = b"".join(frames.select(stream[k : k + size]) for k in range(0, len(stream), size))
    assert passed == b"".join(packed(*one) for one in sent if one[0].get_msgId() in NEEDED)


def test_garbage_before_frame_is_dropped():
    beat = packed(MESSAGES[0], 2)
    assert FrameFilter(NEEDED).select(b"\x00junk" + beat) == beat


def test_signed_frame_passes_whole():
    codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    codec.signing.secret_key, codec.signing.sign_outgoing = bytes(32), True
    beat = MESSAGES[0].pack(codec)
    assert FrameFilter(NEEDED).select(beat + beat) == beat + beat


def test_needed_messages_equal_handled_ones():
    handled = {name.removeprefix("_on_").upper() for name in vars(MissionClient) if name.startswith("_on_")}
    assert {mavlink.mavlink_map[number].msgname for number in NEEDED} == handled
