"""Definitions of messages, and digests of logs."""

import hashlib
import struct

import numpy as np
import pytest

from lapwing.messages.codec import make_class
from lapwing.messages.digest import Digest
from lapwing.messages.parse import Field, dependencies, parse, read_folder, schema_text

TEXT = """
# a comment
int8 LOW=-1   # constant
string WORD="two words"
float64 x 1.5
bool on true
string name
Inner[] items   # same package
std_msgs/Header header
float32[3] three
"""


def test_fields_constants_and_defaults():
    definition = parse("a/msg/B", TEXT)
    assert definition.constants == {"LOW": -1, "WORD": "two words"}
    assert definition.fields == (
        Field("float64", "x", None, 1.5),
        Field("bool", "on", None, True),
        Field("string", "name", None, ""),
        Field("a/msg/Inner", "items", 0, None),
        Field("std_msgs/msg/Header", "header", None, None),
        Field("float32", "three", 3, None),
    )


@pytest.mark.parametrize("line", ["float64", "float64[<=3] x", "string<=5 x", "string[3] x", "float64 2x", "!"])
def test_invalid_line_is_rejected(line):
    with pytest.raises(ValueError, match="a/msg/B, line 2: ") as caught:
        parse("a/msg/B", "int8 a\n" + line)
    assert "\n" not in str(caught.value)


def write(folder, **texts):
    (folder / "p").mkdir()
    for name, text in texts.items():
        (folder / "p" / f"{name}.msg").write_text(text)
    return read_folder(folder)


def test_contained_types_precede_but_follow_in_schema(tmp_path):
    result = write(tmp_path, A="B b\nC c\n", B="C c\n", C="int8 x\n")
    assert list(result) == ["p/msg/C", "p/msg/B", "p/msg/A"]
    assert dependencies("p/msg/A", result) == ["p/msg/B", "p/msg/C"]
    bar = "=" * 80
    assert schema_text("p/msg/A", result) == f"B b\nC c\n{bar}\nMSG: p/B\nC c\n{bar}\nMSG: p/C\nint8 x\n"


def test_missing_type_is_rejected(tmp_path):
    with pytest.raises(ValueError, match=r"p/msg/A: field b has type p/msg/B, which has no \.msg file"):
        write(tmp_path, A="B b\n")


def test_class_of_new_definition_round_trips(tmp_path):
    result = write(tmp_path, A="int8 x\nint64 big\nB[] many\nuint16[] words\nint8 last\n", B="string s\nfloat64[] v\n")
    classes: dict = {}
    for name, definition in result.items():
        classes[name] = make_class(definition, result, classes)
    A, B = classes["p/msg/A"], classes["p/msg/B"]
    message = A(1, -2, (B("one", (1.0,)), B("", ()), B("three", (1.0, 2.0, 3.0))), (1, 2, 3), -4)
    assert A.decode(message.encode()) == message


A = [("/a", t, bytes([t % 256])) for t in range(5000)]
B = [("/b", t, b"x" * (t % 7)) for t in range(300)]


def digest(entries):
    result = Digest()
    for entry in entries:
        result.update(*entry)
    return result.hexdigest()


def test_digest_equals_definition():
    parts = hashlib.blake2b(b"".join(struct.pack("<qQ", t, len(p)) + p for _, t, p in A), digest_size=32)
    assert digest(A) == hashlib.blake2b(b"\2\0\0\0/a" + parts.digest(), digest_size=16).hexdigest()


def test_digest_is_independent_of_topic_interleaving():
    mixed = [entry for pair in zip(A, B, strict=False) for entry in pair] + A[len(B) :]
    assert digest(A + B) == digest(B + A) == digest(mixed)


@pytest.mark.parametrize(
    "other",
    [
        [A[1], A[0], *A[2:]],
        A[:-1],
        [("/c", t, p) for _, t, p in A],
        [("/a", 1, A[0][2]), *A[1:]],
        [("/a", 0, b"\1"), *A[1:]],
    ],
)
def test_digest_depends_on_order_times_names_and_contents(other):
    assert digest(other) != digest(A)


def test_hexdigest_leaves_digest_unchanged():
    one, other = Digest(), Digest()
    for entry in A[:10]:
        one.update(*entry)
        one.hexdigest()
        other.update(*entry)
    assert one.hexdigest() == other.hexdigest()


@pytest.mark.parametrize("n", [0, 1, 300])
def test_batch_digest_equals_message_digests(n):
    rng = np.random.default_rng(n)
    times = rng.integers(-5, 1 << 60, n)
    payloads = rng.integers(0, 256, (n, 37), dtype=np.uint8)
    one, batch = Digest(), Digest()
    for digest_ in (one, batch):
        digest_.update("/b", 1, b"before")
    for time_ns, payload in zip(times.tolist(), payloads, strict=True):
        one.update("/a", time_ns, payload.tobytes())
        one.update("/b", time_ns, payload.tobytes())
    batch.update_batch("/a", times, payloads)
    batch.update_batch("/b", times, payloads)
    for digest_ in (one, batch):
        digest_.update("/b", 2, b"behind")
    assert one.hexdigest() == batch.hexdigest()


def test_batch_needs_time_for_each_payload():
    with pytest.raises(ValueError, match="/a: 2 times for 3 payloads"):
        Digest().update_batch("/a", np.zeros(2, np.int64), np.zeros((3, 8), np.uint8))
