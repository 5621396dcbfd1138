"""MAVLink FTP: files are read over a lossy link and cannot be changed."""

import json
import struct

import pytest
from adapter_harness import Bench
from pymavlink.dialects.v20 import all as mavlink

from lapwing.services.common.mavlink.dialect import id_of
from lapwing.services.mavlink.component_metadata import GENERAL, PARAMETERS, files
from lapwing.services.mavlink.file_server import DATA, FileServer, crc32
from lapwing.services.mavlink.resolve import describe
from lapwing.services.scene_resolver import load

CONTENT = bytes(range(256)) * 100
OPEN, READ, BURST = 4, 5, 15


def request(opcode, data=b"", session=0, size=None, offset=0, sequence=7):
    head = struct.pack("<HBBBBBxI", sequence, session, opcode, len(data) if size is None else size, 0, 0, offset)
    return (head + data).ljust(251, b"\0")


def parsed(payload):
    sequence, session, opcode, size, of, last, offset = struct.unpack_from("<HBBBBBxI", payload)
    return sequence, session, opcode, of, last, offset, bytes(payload[12 : 12 + size])


@pytest.fixture
def server():
    return FileServer({"etc/a.bin": CONTENT, "etc/b/c.txt": b"hello"})


def error_code(server, *arguments, **more):
    ((*_, data),) = [parsed(p) for p in server.replies(request(*arguments, **more))]
    return data[0]


def test_file_is_read_in_pieces(server):
    sequence, session, opcode, of, _, _, data = parsed(server.replies(request(OPEN, b"/etc/a.bin"))[0])
    assert (sequence, opcode, of, struct.unpack("<I", data)[0]) == (8, 128, OPEN, len(CONTENT))
    result = b""
    while len(result) < len(CONTENT):
        (reply,) = server.replies(request(READ, session=session, size=DATA, offset=len(result)))
        assert parsed(reply)[5] == len(result)
        result += parsed(reply)[6]
    assert result == CONTENT
    assert error_code(server, READ, session=session, size=DATA, offset=len(CONTENT)) == 6  # end of file


def test_burst_is_numbered_and_marks_its_end(server):
    session = parsed(server.replies(request(OPEN, b"etc/a.bin"))[0])[1]
    result, bursts = b"", 0
    while len(result) < len(CONTENT):
        replies = [parsed(p) for p in server.replies(request(BURST, session=session, size=DATA, offset=len(result)))]
        assert [r[0] for r in replies] == list(range(8, 8 + len(replies)))
        assert [r[4] for r in replies] == [0] * (len(replies) - 1) + [1]
        result += b"".join(r[6] for r in replies)
        bursts += 1
    assert result == CONTENT
    assert bursts == 4


def test_repeated_request_gets_same_reply_in_same_session(server):
    first = server.replies(request(OPEN, b"etc/a.bin"))
    assert [server.replies(request(OPEN, b"etc/a.bin")) for _ in range(10)] == [first] * 10
    assert parsed(server.replies(request(OPEN, b"etc/a.bin", sequence=9))[0])[1] == 1


def test_sessions_are_closed_and_limited(server):
    for k in range(4):
        server.replies(request(OPEN, b"etc/a.bin", sequence=k))
    assert error_code(server, OPEN, b"etc/a.bin", sequence=5) == 5
    server.replies(request(1, session=2, sequence=6))
    assert parsed(server.replies(request(OPEN, b"etc/a.bin", sequence=8))[0])[1] == 2
    server.replies(request(2, sequence=9))
    assert error_code(server, READ, session=2, size=10, sequence=10) == 4


def test_folders_are_listed(server):
    assert parsed(server.replies(request(3, b"/"))[0])[6] == b"Detc\0"
    assert parsed(server.replies(request(3, b"/etc"))[0])[6] == b"Db\0Fa.bin\t25600\0"
    assert parsed(server.replies(request(3, b"etc", offset=1))[0])[6] == b"Fa.bin\t25600\0"
    assert error_code(server, 3, b"etc", offset=2) == 6


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ((OPEN, b"etc/none"), 10),
        ((3, b"none"), 10),
        ((14, b"none"), 10),
        ((7, b"x"), 9),
        ((8, b"etc/a.bin"), 9),
        ((99,), 7),
        ((READ,), 4),
        ((OPEN, b"\xff\xfe"), 10),
    ],
)
def test_impossible_file_request_is_rejected_with_reason(server, arguments, error):
    assert error_code(server, *arguments) == error


def test_checksum_matches_protocol(server):
    def slow(data):
        crc = 0
        for byte in data:
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
        return crc

    assert crc32(b"hello") == slow(b"hello")
    assert struct.unpack("<I", parsed(server.replies(request(14, b"etc/b/c.txt"))[0])[6])[0] == slow(b"hello")


def test_metadata_describes_every_listed_parameter():
    bench = Bench()
    station = bench.station()
    bench.step(2)
    assert station.command(512, id_of("COMPONENT_METADATA")) == mavlink.MAV_RESULT_ACCEPTED
    m = station.last("COMPONENT_METADATA")
    text = m.uri if isinstance(m.uri, str) else m.uri.rstrip(b"\0").decode()
    assert text.rstrip("\0") == f"mftp://{GENERAL}"

    def fetch(path):
        station.send("file_transfer_protocol", 0, 1, 1, list(request(OPEN, path.encode())))
        _, session, *_ = parsed(bytes(station.last("FILE_TRANSFER_PROTOCOL").payload))
        result = b""
        while True:
            station.got.clear()
            payload = request(BURST, session=session, size=DATA, offset=len(result))
            station.send("file_transfer_protocol", 0, 1, 1, list(payload))
            replies = [parsed(bytes(r.payload)) for r in station.all("FILE_TRANSFER_PROTOCOL")]
            if replies[0][2] == 129:
                return result
            result += b"".join(r[6] for r in replies)

    general = fetch(GENERAL)
    assert crc32(general) == m.file_crc
    entry, events, actuators = json.loads(general)["metadataTypes"]
    assert crc32(fetch(actuators["uri"].removeprefix("mftp://"))) == actuators["fileCrc"]
    assert entry["uri"] == f"mftp://{PARAMETERS}"
    assert crc32(fetch(events["uri"].removeprefix("mftp://"))) == events["fileCrc"]
    table = fetch(PARAMETERS)
    assert crc32(table) == entry["fileCrc"]
    described = {p["name"]: p for p in json.loads(table)["parameters"]}
    station.got.clear()
    station.send("param_request_list", 1, 1)
    bench.step(20)
    assert {v.param_id for v in station.all("PARAM_VALUE")} == set(described)
    assert described["MIS_TAKEOFF_ALT"] | {"min": 0.5, "max": 100.0, "units": "m"} == described["MIS_TAKEOFF_ALT"]
    assert described["NAV_DLL_ACT"]["type"] == "Int32"


def test_metadata_marks_restart_and_read_only():
    content = files(describe(load("lapwing/scenes/groundstation.toml")))[PARAMETERS]
    described = {p["name"]: p for p in json.loads(content)["parameters"]}
    assert [name for name, p in described.items() if p.get("rebootRequired")] == [
        "EKF2_HGT_REF",
        "MAV_COMP_ID",
        "MAV_SYS_ID",
        "SYS_HAS_GPS",
    ]
    assert described["SYS_AUTOSTART"]["readOnly"]
    assert not [name for name in ("NAV_DLL_ACT", "GF_ACTION", "MAV_TYPE") if "readOnly" in described[name]]


def test_scenes_metadata_is_json_without_nan():
    for content in files(describe(load("lapwing/scenes/groundstation.toml"))).values():
        json.loads(content, parse_constant=pytest.fail)
