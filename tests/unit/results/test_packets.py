"""The deliveries of packets are counted in columns as they would be one by one, wherever the trace is stored."""

from collections import Counter
from typing import Any
from unittest import mock

from hypothesis import given, settings
from hypothesis import strategies as st

from fanet_mw.scenario import config
from fanet_mw.trace import Delivered, Generated, Record
from fanet_mw.units import MS, S
from sim.recording import tables
from sim.records.trace_log import TraceLog
from sim.results.outcome import Outcome
from sim.results.packets import packets_of

NODES = 4
APPS = ("traffic", "report", "my_app")


SCENARIO = config.build(
    {
        "duration_s": 10,
        "nodes": {"count": NODES, "telemetry_hz": 0},
        "clusters": {"count": 1},
        "traffic": {"sources": "all", "interval_s": 1, "targets": [1, 3]},
    }
)

sent = st.builds(
    lambda node, seq, app: Generated(5 * S, node, seq, app, 100),
    st.integers(1, 2), st.integers(0, 1), st.sampled_from(APPS),
)  # fmt: skip
heard = st.builds(
    lambda node, origin, seq, wrong_ns, ms: Delivered(
        5 * S + ms * MS, node, origin, seq, ms * MS + wrong_ns, 1, ms * 1000
    ),
    st.sampled_from((1, 1, 3, 3, 4, 0, NODES + 1, 60_000)), st.integers(1, 2), st.integers(0, 2),
    st.sampled_from((0, 0, 0, 7)), st.integers(0, 99),
)  # fmt: skip

MOST = st.integers(1, 12)
"""The number of records of a trace that stay in memory."""


def one_by_one(records: list[Record]) -> dict[str, Any]:
    """(place among the packets of its application, node, delay, handover) of each delivery that counts, by application;
    the repeated ones; the unknown ones.
    """
    packets: dict[tuple[int, int], tuple[str, int]] = {}
    number: Counter[str] = Counter()
    for one in records:
        if isinstance(one, Generated) and (one.node, one.seq) not in packets:
            packets[one.node, one.seq] = one.app, number[one.app]
            number[one.app] += 1
    rows: dict[str, list[tuple[int, ...]]] = {app: [] for app in APPS}
    repeated: Counter[str] = Counter()
    unknown = 0
    had = set()
    for one in records:
        if not isinstance(one, Delivered):
            continue
        name = one.origin, one.seq
        if name not in packets or one.t_ns - one.delay_ns != 5 * S:
            unknown += 1
            continue
        app, place = packets[name]
        meant = (1, 3) if app == "traffic" else range(1, NODES + 1)
        if one.node == one.origin or one.node not in meant:
            continue
        if (name, one.node) in had:
            repeated[app] += 1
        else:
            had.add((name, one.node))
            rows[app].append((place, one.node, one.delay_ns, one.handover_ns))
    return {"rows": rows, "repeated": {app: repeated[app] for app in APPS}, "unknown": unknown}


@given(
    packets=st.lists(sent, min_size=1, max_size=8),
    deliveries=st.lists(heard, min_size=5, max_size=40),
    most=st.integers(1, 12),
)
def test_deliveries_count_as_they_would_one_by_one(
    packets: list[Generated], deliveries: list[Delivered], most: int
) -> None:
    records: list[Record] = [*packets, *deliveries]
    log = TraceLog(most_in_memory=most, most_packed_bytes=100 * most)
    for one in records:
        log.extend([one])
    for trace in (records, log):
        found = packets_of(Outcome(SCENARIO, "virtual", 1.0, trace, {}))
        apps = {app: found[app] for app in APPS if app in found}
        rows = {
            app: list(zip(*(column.tolist() for column in part.deliveries), strict=True)) for app, part in apps.items()
        }
        expected = one_by_one(records)
        assert rows == {app: expected["rows"][app] for app in apps}
        assert {app: part.repeated for app, part in apps.items()} == {app: expected["repeated"][app] for app in apps}
        assert found["traffic"].unknown == expected["unknown"]


@settings(max_examples=25)
@given(packets=st.lists(sent, min_size=1, max_size=8), deliveries=st.lists(heard, min_size=9, max_size=20))
def test_the_table_of_deliveries_has_each_in_its_units_and_says_which_ones_count(
    packets: list[Record], deliveries: list[Record]
) -> None:
    """Those are as many of each packet as the summary counts; a table that is written in portions has the same rows."""
    outcome = Outcome(SCENARIO, "virtual", 1.0, [*packets, *deliveries], {})
    rows = tables.table("deliveries", outcome).to_pylist()
    told = [(one.t_ns / S, one.node, one.origin, one.seq, one.delay_ns / MS, one.hops, one.handover_ns / MS)
            for one in outcome.records if isinstance(one, Delivered)]  # fmt: skip
    assert [tuple(row.values())[:4] + tuple(row.values())[5:8] for row in rows] == told
    summed = {app: found.deliveries for app, found in packets_of(outcome).items()}
    for app in {row["app"] for row in rows} - {""}:
        counted = sum(row["counts"] for row in rows if row["app"] == app)
        assert counted == (len(summed[app].node) if app in summed and app != "my_app" else 0)
    assert not any(row["counts"] for row in rows if row["app"] == "")
    with mock.patch.object(tables, "_PORTION", 3):
        assert tables.table("deliveries", outcome).to_pylist() == rows


def test_a_packet_that_two_records_name_is_sent_once() -> None:
    records = [Generated(5 * S, 2, 7, "traffic", 100), Generated(6 * S, 2, 7, "traffic", 100)]
    traffic = packets_of(Outcome(SCENARIO, "virtual", 1.0, records, {}))["traffic"]
    assert [one.born_ns for one in traffic.sent.values()] == [5 * S]
    assert traffic.wanted == 2
