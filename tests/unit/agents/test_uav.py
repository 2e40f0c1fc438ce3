"""The application of one UAV, hand-driven: when it announces, what it counts and what an inspector sees."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from agents.uav import Uav
from fanet_mw import wire
from fanet_mw.bus.messages import MavlinkTap, Reception, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_REPORT, Header, Kind
from fanet_mw.wire.survivors import Survivor

NAMES, LEAD_NS = Topics("u"), 20 * MS
MakeScenario = Callable[..., Scenario]


def uav(make_scenario: MakeScenario, **keys: Any) -> Uav:
    given = {"nodes.count": 3, "routing.protocol": "flooding", "radio.lead_ms": 20, "routing.hello_interval_s": 1}
    made = Uav(make_scenario(**given | keys), NodeId(2), "u", position=Enu(0.0, 0.0, 50.0))
    made.start(0)
    return made


def advance(made: Uav, until_ns: int) -> list[tuple[int, TxRequest]]:
    """(when it was announced, the request), woken just when it asks to be."""
    found = []
    while (wake_ns := made.next_wake_ns()) is not None and wake_ns <= until_ns:
        made.wake(wake_ns)
        found += [(wake_ns, message) for _, message in made.outbox if isinstance(message, TxRequest)]
        made.outbox.clear()
    return found


def test_hellos_are_announced_a_lead_ahead_and_vary_by_a_tenth(make_scenario: MakeScenario) -> None:
    said = advance(uav(make_scenario, **{"traffic.arrivals": "none"}), 60 * S)
    assert {request.start_ns - at_ns for at_ns, request in said} == {LEAD_NS}
    gaps = [(b.start_ns - a.start_ns) / S for (_, a), (_, b) in pairwise(said)]
    assert 0.9 <= min(gaps) < 0.93 < 1.07 < max(gaps) <= 1.1


def test_traffic_is_counted_as_it_is_generated_and_goes_a_lead_later(make_scenario: MakeScenario) -> None:
    keys = {"traffic.sources": "all", "traffic.interval_s": 0.5, "duration_s": 10, "routing.hello_interval_s": 0}
    made = uav(make_scenario, **keys)
    said = advance(made, 10 * S)
    assert len(said) == made.report()["generated"] == 20
    assert all(request.start_ns == at_ns + LEAD_NS for at_ns, request in said)


def test_who_inspects_a_uav_sees_the_reports_that_it_gets(make_scenario: MakeScenario) -> None:
    made = uav(make_scenario, **{"mission.survivors": 2})
    report = Survivor(900_000, 1, 3, Enu(10.0, 20.0, 50.0), -70.0)
    header = Header(900_000, 5, 3, BROADCAST, 3, Kind.DATA, 8, 0, PRIORITY_REPORT, FLAG_FLOOD)
    frame = header.encode() + report.encode_frame(3)
    made.receive(NAMES.radio_rx(NodeId(2)), Reception(frame, NodeId(3), 1 * S, -60.0), 1 * S)
    taps = [message.data for topic, message in made.outbox if isinstance(message, MavlinkTap)]
    assert taps == [frame]
    assert wire.decode_header(taps[0]).origin == 3


@pytest.mark.parametrize("late_ms", [0, 20, 21])
def test_a_reception_later_than_a_lead_after_its_end_is_counted(make_scenario: MakeScenario, late_ms: int) -> None:
    made = uav(make_scenario)
    header = Header(900_000, 5, 3, BROADCAST, 3, Kind.DATA, 8, 0, 3, FLAG_FLOOD)
    reception = Reception(header.encode() + wire.filler(40), NodeId(3), 1 * S, -60.0)
    made.receive(NAMES.radio_rx(NodeId(2)), reception, 1 * S + late_ms * MS)
    assert made.report()["heard_late"] == (late_ms > 20)
