"""What a service publishes comes out of its journal again, tick by tick."""

from pathlib import Path

from messages import Clock, PoseStamped, stamp
from messages.topics import CLOCK, POSE, STATUS, TOPICS
from services import journal
from services.journal import JOURNAL_KEY, PAGE, Outlets, entries
from services.scene import load

SCENE = load(Path("scenes/hover.toml"))
TICK = 4_000_000


class Recorded:
    """A process with a bus that keeps what is put: `puts` holds (key, time [ns], payload)."""

    name, space, scene = "plant", "here", SCENE

    def __init__(self):
        self.puts = []
        self.bus = self

    def publisher(self, key):
        return lambda payload, time_ns: self.puts.append((key, time_ns, payload))

    def key(self, topic):
        return topic.zenoh_key("drone1", self.space)

    def pages(self):
        return [payload for key, _, payload in self.puts if key == f"here/{JOURNAL_KEY}/plant"]


def clock(tick):
    return Clock(stamp(tick * TICK))


def test_entries_give_back_what_was_published():
    process = Recorded()
    outlets = Outlets(process, [CLOCK, POSE])
    for tick in range(10):
        outlets.publish(tick, [(CLOCK, clock(tick)), (POSE, PoseStamped())])
    outlets.end(10)
    *pages, last = process.pages()
    assert last == b""  # there will be no more
    expected = [(t, k, m.encode()) for k in range(10) for t, m in ((CLOCK, clock(k)), (POSE, PoseStamped()))]
    assert [entry for page in pages for entry in entries(page)] == expected


def test_each_message_goes_out_at_once_with_its_time_and_an_empty_one_at_the_end():
    process = Recorded()
    outlets = Outlets(process, [CLOCK])
    outlets.publish(3, [(CLOCK, clock(3))])
    outlets.end(4)
    sent = [(time_ns, payload) for key, time_ns, payload in process.puts if key == "here/clock"]
    assert sent == [(3 * TICK, clock(3).encode()), (4 * TICK, b"")]


def test_a_full_page_is_handed_over_before_the_end(monkeypatch):
    monkeypatch.setattr(journal.time, "monotonic", lambda: 0.0)  # only its length counts
    process = Recorded()
    outlets = Outlets(process, [POSE])
    length = len(PoseStamped().encode())
    for tick in range(PAGE // length + 1):
        assert process.pages() == []
        outlets.publish(tick, [(POSE, PoseStamped())])
    assert len(process.pages()) == 1


def test_an_empty_page_has_no_entries():
    assert list(entries(b"")) == []


def test_every_topic_has_a_place_in_the_journal():
    page = b"".join(journal._ENTRY.pack(i, 2**40, 1) + bytes([i]) for i in range(len(TOPICS)))
    assert list(entries(page)) == [(topic, 2**40, bytes([i])) for i, topic in enumerate(TOPICS)]
    assert STATUS in TOPICS
