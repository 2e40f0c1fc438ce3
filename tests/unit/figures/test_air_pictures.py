"""The air of a run: why each frame was sent, and the fewest senders that reach everyone."""

import pytest
from kit import MakeScenario

from emulator.pcap_reader import AirFrame
from fanet_mw.trace import Generated, Posed
from fanet_mw.units import BROADCAST, S
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_BULK, PRIORITY_SAFETY, Header, Kind, filler
from sim.report.air_pictures import Air, Cause, against_dominating_set, greedy_dominating_set, losses, rows
from sim.report.run_records import RunRecords


def frame(
    sender: int, origin: int, seq: int, *, kind: Kind = Kind.DATA, attempt: int = 1, priority: int = PRIORITY_BULK
) -> AirFrame:
    header = Header(0, seq, origin, BROADCAST, sender, kind, 8, 0, priority, FLAG_FLOOD)
    payload = header.encode() + filler(40)
    return AirFrame(seq, "sent", sender, None, None, len(payload), attempt, None, payload)


def test_each_frame_has_its_cause(make_scenario: MakeScenario) -> None:
    air = Air(
        make_scenario(),
        [
            frame(1, 1, 7), frame(2, 1, 7), frame(2, 1, 7), frame(1, 1, 8, attempt=2),
            frame(1, 1, 9, kind=Kind.HELLO), frame(1, 1, 9, kind=Kind.JOIN),
            AirFrame(9, "ack", None, 1, None, 0, None, None),
            frame(3, 1, 7)._replace(payload=b"somebody else's"),
        ],
    )  # fmt: skip
    assert [one.cause for one in air.sent] == [
        Cause.OWN, Cause.RELAYED, Cause.AGAIN, Cause.AGAIN, Cause.HELLO, Cause.CONTROL, Cause.ACK, Cause.CONTROL,
    ]  # fmt: skip
    assert air.times == {(1, 7): 3, (1, 8): 1}


def test_shares_of_the_air_are_told_by_cause_and_priority(make_scenario: MakeScenario) -> None:
    sent = [frame(1, 1, 7), frame(2, 1, 7), frame(1, 1, 8, priority=PRIORITY_SAFETY), frame(1, 1, 9, kind=Kind.HELLO)]
    assert [row[:4] for row in rows(Air(make_scenario(), sent)).rows] == [
        ["own packets", "safety", "1", "25 %"],
        ["own packets", "bulk", "1", "25 %"],
        ["relayed", "bulk", "1", "25 %"],
        ["hellos", "-", "1", "25 %"],
    ]


def test_what_was_lost_is_told_with_its_reason() -> None:
    summary = {
        "copies": {"on_air": 200, "lost": {"half_duplex": 5, "collision": 20}},
        "frames": {"sent": 50, "dropped": {"collision": 1}},
    }
    assert [list(row) for row in losses(summary).rows] == [
        ["copies at stations in range", "collision", "20", "10 %"],
        ["copies at stations in range", "half duplex", "5", "2.5 %"],
        ["frames that no station received", "collision", "1", "2 %"],
    ]


@pytest.mark.parametrize(
    ("links", "size"),
    [
        ({}, 0),
        ({1: {2, 3, 4}, 2: {1}, 3: {1}, 4: {1}}, 1),
        ({1: {2}, 2: {1, 3}, 3: {2, 4}, 4: {3, 5}, 5: {4}}, 3),
        ({1: {2}, 2: {1}, 3: set()}, 1),
    ],
)
def test_a_greedy_set_reaches_everyone_of_the_greatest_part(links: dict[int, set[int]], size: int) -> None:
    assert len(greedy_dominating_set(links)) == size


def test_the_post_is_among_the_nodes_that_a_flood_must_reach(make_scenario: MakeScenario) -> None:
    """Three UAVs in a line 100 m apart, and 120 m from the last one the post, whose antenna has a gain."""

    def said(gain_dbi: float) -> str:
        post = {"ground.at_m": [220, 0], "ground.antenna_m": 1, "ground.gain_dbi": gain_dbi}
        run = RunRecords(make_scenario(**{"nodes.count": 3, "radio.range_m": 110, **post}))
        flown = [Posed(second * S, node, 100.0 * (node - 2), 0.0, 1.0) for second in range(10) for node in (1, 2, 3)]
        run.read([*flown, Generated(S, 1, 7, "traffic", 40)])
        return against_dominating_set(run, Air(run.scenario, [frame(1, 1, 7), frame(2, 1, 7), frame(3, 1, 7)]))

    assert "has 2 nodes (mean of 12 instants): 1.50 times" in said(4.0)
    assert "has 1 nodes" in said(0.0)
