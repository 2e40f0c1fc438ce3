"""The collector of a run: no put on the bus ends a run, or gets into its result unchecked."""

import copy
import errno
import gc
import json
import os
import re
import struct
import tracemalloc
from array import array
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from emulator.medium import Medium
from fanet_mw.bus import codecs
from fanet_mw.bus.link_stats import COUNTS, LinkStats
from fanet_mw.bus.messages import MavlinkTap, Message, Report, TraceBatch
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import ConfigError
from fanet_mw.hosts.bus import OnSample
from fanet_mw.scenario import config
from fanet_mw.trace import (
    Approaching,
    Arrived,
    Collided,
    Delivered,
    Detected,
    Dropped,
    Generated,
    MissionModeChanged,
    Posed,
    ProcessEnded,
    RadioFault,
    Record,
    RoleChanged,
    Sighted,
)
from fanet_mw.units import S
from sim.records.spool import Spool
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.collecting.collector import BURST_BYTES, BYTES_PER_S, Allowance, Collector
from sim.run.virtual import simulate
from sim.scenarios import catalog

NAMES = Topics("swarm")
SCENARIO = catalog.find(
    "clusters",
    ["nodes.count=9", "nodes.layout=grid", "traffic.sources=8", "clusters.count=4", "duration_s=9", "warmup_s=6",
     "drain_s=1", "mission.survivors=2", "mission.collision_distance_m=5", "mission.collision_horizon_s=5"],
)  # fmt: skip
END_NS = SCENARIO.duration_ns


class Ear:
    """A collector, and the puts it hears; time stands still unless moved."""

    def __init__(self, folder: Path | None = None) -> None:
        self.now_ns = 0
        self._hear: dict[str, OnSample] = {}
        self.collector = Collector(SCENARIO, self._subscribe, NAMES, now_ns=lambda: self.now_ns, folder=folder)

    def _subscribe(self, expression: str, on_sample: OnSample) -> None:
        self._hear[expression.rpartition("/")[0]] = on_sample

    def put(self, topic: str, payload: bytes) -> None:
        self._hear[topic.rpartition("/")[0]](topic, payload)

    def say(self, topic: str, *messages: Message) -> dict[str, int]:
        self.put(topic, codecs.encode(messages))
        return self.why

    @property
    def why(self) -> dict[str, int]:
        return dict(self.collector._refused)

    @property
    def stored_bytes(self) -> int:
        return self.collector._records._deliveries.size + self.collector._records._others.size

    def outcome(self) -> Outcome:
        return self.collector.outcome(wall_s=1.0)


@pytest.fixture
def ear() -> Iterator[Ear]:
    made = Ear()
    with closing(made.collector):
        yield made


@pytest.fixture(scope="module")
def genuine() -> Outcome:
    return simulate(SCENARIO)


def speaker(record: Record) -> str:
    return {Collided: "world", Posed: "world", RadioFault: "emulator"}.get(type(record), f"agent-{record.node}")


def replay(ear: Ear, outcome: Outcome) -> None:
    """All that the actors of a run would have put."""
    for record in outcome.records:
        ear.say(NAMES.trace(speaker(record)), TraceBatch((record,)))
    for name, content in outcome.reports.items():
        ear.say(NAMES.report(name), Report(name, END_NS, json.dumps(content)))
    for node in SCENARIO.node_ids:
        for t_ns, data in [*outcome.taps][node :: SCENARIO.nodes.count]:
            ear.say(NAMES.mavlink(node), MavlinkTap(t_ns, data))


def test_who_has_sent_no_report_for_long_is_silent_until_it_sends_the_next(ear: Ear, genuine: Outcome) -> None:
    def report(name: str) -> None:
        ear.say(NAMES.report(name), Report(name, END_NS, json.dumps(genuine.reports[name])))

    everyone = set(genuine.reports)
    assert ear.collector.silent(4 * S) == set(), "the swarm's time has not begun"
    ear.collector.begin()
    ear.now_ns = 3 * S
    for name in everyone - {"world"}:
        report(name)
    assert ear.collector.silent(4 * S) == set()
    ear.now_ns = 5 * S
    assert ear.collector.silent(4 * S) == {"world"}
    report("world")
    assert ear.collector.silent(4 * S) == set()
    ear.now_ns = 20 * S
    ear.collector.begin("world", "agent-1")
    ear.now_ns = 23 * S
    assert ear.collector.silent(4 * S) == everyone - {"world", "agent-1"}


def test_an_emulator_that_is_started_again_tells_no_planned_fault_twice(ear: Ear) -> None:
    cuts = [{"node": 2, "at_s": 1.0, "for_s": 1.0}, {"node": 3, "at_s": 2.5}, {"node": 3, "at_s": 6.0}]
    scenario = config.build(
        {"nodes": {"count": 9}, "duration_s": 9, "faults": [{"kind": "cut", **one} for one in cuts]}
    )

    def lived(*, since_s: float, until_s: float) -> list[Record]:
        medium = Medium(scenario, "swarm")
        medium.start(round(since_s * S))
        medium.wake(round(until_s * S))
        return list(medium.records)

    whole = lived(since_s=0, until_s=9)
    assert len(whole) == 5, "the second of node 3 ends the first"
    for since_s, until_s in ((0, 2), (3, 5), (5.5, 9)):  # of the fault at 2.5 s the third life could tell, too
        for record in lived(since_s=since_s, until_s=until_s):
            ear.say(NAMES.trace("emulator"), TraceBatch((record,)))
    assert list(ear.outcome().records) == whole
    assert ear.why == {}
    standing = codecs.decode(ear.collector.standing())
    assert [record.t_ns for record in standing[0].records] == [6 * S]


def test_what_genuine_actors_say_passes_and_gives_the_result_of_the_run(ear: Ear, genuine: Outcome) -> None:
    replay(ear, genuine)
    assert ear.why == {}
    assert ear.outcome().absent == {}
    heard = ear.outcome()
    assert sorted(heard.records, key=repr) == sorted(genuine.records, key=repr)
    assert sorted(heard.taps) == sorted(genuine.taps)
    ours = replace(genuine, reports=json.loads(json.dumps(dict(genuine.reports))), mode="realtime")
    for key in ("pdr", "delay_ms", "frames", "copies", "air", "bound", "mission", "separation"):
        assert finish(heard, out=None)[key] == finish(ours, out=None)[key], key


@pytest.mark.parametrize(
    ("name", "record", "why"),
    [
        ("agent-3", Delivered(S, 77, 1, 1, 5, 1), "node"),
        ("agent-3", Delivered(S, 4, 1, 1, 5, 1), "speaker"),
        ("agent-3", Delivered(S, 3, 77, 1, 5, 1), "node"),
        ("agent-3", Generated(S, 0, 1, "traffic", 5), "node"),
        ("agent-3", Approaching(S, 3, 3, 3, 1.0, 1.0), "survivor"),
        ("agent-3", Detected(S, 3, 0, -50.0), "survivor"),
        ("agent-3", Arrived(S, 3, -1), "survivor"),
        ("agent-3", Sighted(S, 3, "camera", 3, 1.0, 1.0), "survivor"),
        ("agent-3", MissionModeChanged(S, 3, "respond", -1), "survivor"),
        ("agent-3", RoleChanged(2**62, 3, "head", 1, 3), "instant"),
        ("agent-3", Dropped(-(2**62), 3, "expired", 1, 1), "instant"),
        ("agent-3", Collided(S, 3, 4), "speaker"),
        ("agent-3", RadioFault(S, 3, 0, "cut", "x", active=True), "speaker"),
        ("emulator", ProcessEnded(S, 3, "agent-3", 0), "speaker"),
        ("world", Collided(S, 10, 4), "node"),
    ],
)
def test_a_record_that_its_speaker_cannot_mean_is_counted_and_goes_no_further(
    ear: Ear, name: str, record: Record, why: str
) -> None:
    good = RadioFault(S, 3, 0, "cut", "x", active=True) if name == "emulator" else None
    good = good or (Collided(S, 1, 0) if name == "world" else Generated(S, 3, 1, "traffic", 5))
    assert ear.say(NAMES.trace(name), TraceBatch((good, record))) == {f"trace: {why}": 1}
    assert list(ear.outcome().records) == [good]


def test_a_sighting_of_nobody_known_and_a_mode_for_nobody_pass(ear: Ear) -> None:
    said = (Sighted(S, 3, "camera", 0, 1.0, 1.0), MissionModeChanged(S, 3, "search"))
    assert ear.say(NAMES.trace("agent-3"), TraceBatch(said)) == {}
    assert sorted(ear.outcome().records, key=repr) == sorted(said, key=repr)


@pytest.mark.parametrize(
    "line",
    [
        '["delivered",1,3,"x",1,5,1]', '["delivered",1,3,1,1,5]', '["delivered",1.5,3,1,1,5,1]', '["nothing",1,3]',
        '["delivered",1,3,1,1,' + "9" * 30 + ",1]", '["detected",1,3,1,NaN]', '["detected",1,3,1,Infinity]',
        '["generated",1,3,true,"traffic",5]', '["generated",1,3,1,null,5]', '["delivered",1,3,[],1,5,1]',
        '["role_changed",1,3,"' + "x" * 1000 + '",1,1]', "[]", "{}", "3", "",
    ],
)  # fmt: skip
def test_a_line_that_is_no_record_is_undecodable(ear: Ear, line: str) -> None:
    body = line.encode() or b"\n"
    ear.put(NAMES.trace("agent-3"), bytes([9]) + struct.pack("<I", len(body)) + body)
    assert ear.why == {"trace: undecodable": 1}
    assert list(ear.outcome().records) == []


def test_a_report_without_keys_is_counted_and_the_last_valid_one_stands(ear: Ear, genuine: Outcome) -> None:
    content = dict(genuine.reports["agent-3"])
    ear.say(NAMES.report("agent-3"), Report("agent-3", S, json.dumps(content)))
    for text in ("{}", "[]", "no JSON", "[" * 100_000, json.dumps({**content, "node": 4}), "9" * 5000):
        ear.say(NAMES.report("agent-3"), Report("agent-3", S, text))
    assert ear.say(NAMES.report("agent-3"), Report("agent-4", S, "{}")) == {"report: shape": 6, "report: speaker": 1}
    assert ear.collector.reports() == {"agent-3": json.loads(json.dumps(content))}
    ear.say(NAMES.report("emulator"), Report("emulator", S, '{"kind": "emulator", "frames": 3}'))
    absent = ear.outcome().absent
    assert absent["emulator"] == "malformed: frames: Input should be a valid dictionary or instance of _Frames"
    assert absent["world"] == "no report was heard"
    assert absent["agent-3"].startswith("malformed: "), "of its last one"


@pytest.mark.parametrize("value", ["[" * 13 + "]" * 13, "1e999", "NaN", str(2**63)])
def test_a_report_holds_nothing_that_json_of_others_cannot(ear: Ear, genuine: Outcome, value: str) -> None:
    content = json.dumps({**genuine.reports["agent-3"], "more": 0}).replace('"more": 0', f'"more": {value}')
    assert ear.say(NAMES.report("agent-3"), Report("agent-3", S, content)) == {"report: shape": 1}
    assert ear.outcome().absent["agent-3"] == "malformed: a value beyond its bounds"


def test_an_actor_is_done_when_it_has_sent_its_last_report(ear: Ear, genuine: Outcome) -> None:
    content = dict(genuine.reports["agent-3"])
    for final in (False, True):
        assert "agent-3" in ear.collector.unfinished()
        ear.say(NAMES.report("agent-3"), Report("agent-3", S, json.dumps({**content, "final": final})))
    assert "agent-3" not in ear.collector.unfinished()


def places(content: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The path of every value in a report."""
    for key, value in content.items() if isinstance(content, dict) else ():
        yield (*path, key)
        yield from places(value, (*path, key))


@pytest.mark.slow
def test_no_report_that_gets_through_can_keep_the_result_from_being_computed(genuine: Outcome) -> None:
    """Every value of a genuine report of each kind of actor is left out, and put in place of it what it is not.

    Whatever is not refused must do in the summary. A key that metrics begin to read belongs into the shapes.
    """
    replay(made := Ear(), genuine)
    with closing(made.collector):
        outcome = made.outcome()
    outcome = replace(outcome, records=[*outcome.records][::10])  # a summary takes as long as its trace
    finish(outcome, out=None)
    refused = passed = 0
    for name in ("emulator", "world", "agent-3"):
        whole = dict(outcome.reports[name])
        if name == "agent-3":  # what not every scenario has
            whole |= {"clock": {"jumps": 0, "lost": 0}, "messages": {"confirmed": 1}}
        for path in places(whole):
            if path[0] in ("handed", "dropped") and len(path) > 2:
                continue
            for value in (None, "x", -1, 1.5, 2**70, 1e300, [], {}, [[[[[[[[]]]]]]]], {"1": "x"}, True, ...):
                content = copy.deepcopy(dict(whole))
                inner = content
                for key in path[:-1]:
                    inner = inner[key]
                if value is ...:
                    del inner[path[-1]]
                else:
                    inner[path[-1]] = value
                checked, why = made.collector._checks.report(name, json.dumps(content))
                if why is not None:
                    refused += 1
                    continue
                passed += 1
                summary = finish(replace(outcome, reports={**outcome.reports, name: checked}), out=None)
                json.dumps(summary, allow_nan=False)
    assert refused > 500
    assert passed > 100


@pytest.mark.parametrize(
    ("t_ns", "data", "why"),
    [(2**63 - 1, b"", "instant"), (-1, b"", "instant"), (S, b"no frame", "frame"), (S, b"\xfd\xff\0\0", "frame")],
)
def test_telemetry_that_no_log_can_hold_is_counted(ear: Ear, tmp_path: Path, t_ns: int, data: bytes, why: str) -> None:
    assert ear.say(NAMES.mavlink(3), MavlinkTap(t_ns, data)) == {f"telemetry: {why}": 1}
    assert finish(ear.outcome(), out=tmp_path)["unwritten"] == {}


def stats(*, node: int = 2, t_ns: int = S, rssi_mdbm: int = -70_000) -> LinkStats:
    counts = array("I", [1] * COUNTS)
    return LinkStats(t_ns, S, array("H", [1, node]), counts, array("q", [rssi_mdbm]))


def test_links_of_nodes_that_do_not_exist_are_counted(ear: Ear) -> None:
    ear.say(NAMES.radio_links, stats(node=10), stats(node=0), stats(t_ns=2**62), stats(rssi_mdbm=2**62), stats())
    assert ear.why == {"links: node": 2, "links: instant": 1, "links: rssi": 1}
    assert [(row.src, row.dst) for row in ear.outcome().links.rows()] == [(1, 2)]


def test_sums_of_links_do_not_depend_on_how_many_reports_they_came_in(ear: Ear) -> None:
    for _ in range(1000):
        ear.say(NAMES.radio_links, stats())
    totals = ear.outcome().links
    assert [(row.received, row.rssi_dbm) for row in totals.rows()] == [(1000, -70.0)]
    assert len(totals._pending) < 64


def test_what_is_kept_in_memory_does_not_grow_with_the_length_of_the_run(ear: Ear, genuine: Outcome) -> None:
    """Six stretches of a run of nine UAVs: half a megabyte on disk, and as much in memory as after the second."""

    def stretch() -> None:
        for _ in range(8):
            ear.now_ns += S
            for node in SCENARIO.node_ids:
                delivered = tuple(Delivered(S, node, 1 + i % 9, i, 5_000_000, 2) for i in range(20))
                ear.say(NAMES.trace(f"agent-{node}"), TraceBatch(delivered))
                ear.say(NAMES.mavlink(node), MavlinkTap(S, b""))
            for name, text in reports.items():
                ear.say(NAMES.report(name), Report(name, S, text))
            ear.say(NAMES.radio_links, stats())
            ear.say(NAMES.trace("agent-77"), TraceBatch(()))
            ear.say(NAMES.report("agent-3"), Report("agent-3", S, "{}"))

    reports = {name: json.dumps(content) for name, content in genuine.reports.items()}
    stretch()
    tracemalloc.start()
    try:
        stretch()
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(4):
            stretch()
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert ear.stored_bytes > 300_000
    assert grown < 50_000


@pytest.mark.parametrize("topic", [NAMES.trace("agent-99"), NAMES.report("x" * 200), NAMES.mavlink(99)])
def test_who_is_not_of_the_swarm_is_not_heard(ear: Ear, topic: str) -> None:
    for _ in range(10):
        ear.put(topic, b"x")
    assert sum(ear.why.values()) == 10
    assert all(key.endswith("unknown actor") for key in ear.why)
    assert ear.collector._puts == 10


@pytest.mark.slow
def test_a_flood_of_one_actor_stops_at_its_allowance_and_leaves_the_others_theirs(ear: Ear) -> None:
    flood = codecs.encode([TraceBatch(tuple(Generated(S, 3, i, "traffic" * 20, 5) for i in range(4_000)))])
    for _ in range(60):  # 42 MB
        ear.put(NAMES.trace("agent-3"), flood)
    excess = ear.why["trace: excess"]
    assert (60 - excess) * len(flood) <= BURST_BYTES
    assert ear.stored_bytes <= 1.1 * BURST_BYTES, "a line is a little longer than what was put"
    ear.say(NAMES.trace("agent-4"), TraceBatch((Generated(S, 4, 1, "traffic", 5),)))
    ear.now_ns += 2 * S * len(flood) // BYTES_PER_S
    ear.put(NAMES.trace("agent-3"), flood)
    assert ear.why == {"trace: excess": excess}, "what was said slowly enough is heard again"
    assert list(ear.outcome().records)[-1].node == 4


def deep(levels: int) -> dict[str, Any]:
    return {"in": deep(levels - 1)} if levels > 1 else {}


@pytest.mark.parametrize("before", [False, True])
def test_a_report_beyond_the_allowance_is_named_with_its_size(ear: Ear, genuine: Outcome, before: bool) -> None:
    if before:
        ear.say(
            NAMES.report("agent-3"), Report("agent-3", S, json.dumps({**genuine.reports["agent-3"], "deep": deep(11)}))
        )
        assert ear.outcome().reports["agent-3"]
    ear.say(NAMES.report("agent-3"), Report("agent-3", S, json.dumps({"own": "x" * (BURST_BYTES + 1)})))
    assert ear.why == {"report: excess": 1}
    why = ear.outcome().absent["agent-3"]
    assert re.fullmatch(r"of 16,777,2\d\d bytes; must be <= 16,777,216 at once, 1,048,576 a second", why)


def test_silence_saves_up_no_more_than_a_burst() -> None:
    allowance = Allowance(burst=100, per_s=10)
    assert allowance.take("agent-1", 100, now_ns=0)
    assert not allowance.take("agent-1", 101, now_ns=3600 * S)
    assert allowance.take("agent-1", 100, now_ns=3600 * S)


def test_a_full_disk_under_the_spool_ends_the_trace_and_not_the_run(ear: Ear) -> None:
    """The write call of the spool fails as that of a full disk does: a part is written, then nothing."""
    room = 1000

    def write(descriptor: int, data: bytes, at: int) -> int:
        nonlocal room
        if not room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        written = os.pwrite(descriptor, data[:room], at)
        room -= written
        return written

    ear.collector._records._others._write = write
    for i in range(100):
        ear.say(NAMES.trace("agent-3"), TraceBatch((Generated(S, 3, i, "traffic", 5),)))
    kept = ear.outcome().records
    assert 10 < len(kept) == 100 - ear.why["trace: disk"]
    assert [record.seq for record in kept if isinstance(record, Generated)] == list(range(len(kept)))
    assert ear.collector.disk_failure() == "no space left for the whole of an item"


def test_a_disk_that_takes_nothing_at_all_is_named(ear: Ear) -> None:
    def write(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    ear.collector._records._others._write = write
    for i in range(3):
        ear.say(NAMES.trace("agent-3"), TraceBatch((Generated(S, 3, i, "traffic", 5),)))
    assert list(ear.outcome().records) == []
    assert ear.why["trace: disk"] == 3
    assert ear.collector.disk_failure() == "No space left on device"


def test_deaths_for_which_the_disk_has_no_room_are_counted_as_lost(ear: Ear) -> None:
    ear.say(NAMES.trace("agent-3"), TraceBatch((Generated(S, 3, 1, "traffic", 5),)))
    ear.collector._records._others._write = lambda *_: 0
    assert len(ear.collector.outcome([ProcessEnded(S, 4, "agent-4", -9)], wall_s=1.0).records) == 1
    assert ear.why["trace: disk"] == 1
    assert ear.collector.disk_failure() is not None


def test_a_folder_that_takes_no_file_is_one_message(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="none: no file can be made there: No such file or directory"):
        Spool(tmp_path / "none")


def test_items_come_back_from_a_spool_as_they_were_as_often_as_asked() -> None:
    spool = Spool()
    items = [b"", b"a", b"\n" * 100_000, bytes(range(256))]
    with closing(spool):
        assert all(spool.append(item) for item in items)
        assert list(spool.items()) == items == list(spool.items())
        next(spool.items())
        assert spool.append(b"more"), "somebody stopped reading before the end"
        assert list(spool.items()) == [*items, b"more"]
