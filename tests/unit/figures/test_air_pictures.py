"""The air of a run: why each frame was sent, and the fewest senders that reach everyone."""

import pytest
from kit import MakeScenario

from emulator.pcap_reader import AirFrame
from fanet_mw.units import BROADCAST
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_BULK, PRIORITY_SAFETY, Header, Kind, filler
from sim.report.air_pictures import Air, Cause, greedy_dominating_set, losses, rows


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
