"""A UAV behind a clock of its own, hand-driven: the instants it is given, and what waits until it has swarm time."""

from collections.abc import Callable
from typing import Any

import pytest

from agents.clock.clocked_uav import ClockedUav, make_uav
from fanet_mw.bus.messages import Reception, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Delivered
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_BULK, PRIORITY_CONTROL, Header, Kind, filler
from fanet_mw.wire.schedule import Member, Schedule

NAMES = Topics("c")
MakeScenario = Callable[..., Scenario]


def clocked(make_scenario: MakeScenario, **keys: Any) -> ClockedUav:
    given = {"nodes.count": 3, "clock.sync": "beacons", "clock.offset_ms": 5, "clock.drift_ppm": 20}
    made = make_uav(make_scenario(**given | keys), NodeId(2), "c", position=Enu(0.0, 0.0, 50.0))
    assert isinstance(made, ClockedUav)
    made.start(0)
    return made


def schedule(at_ns: int) -> Reception:
    members = (Member(3, 0, is_head=True), Member(2, 0, is_head=False))
    inner = Schedule(0, 5_000_000, 5_000_000, 1, 1, 1, 0, 1, members, 0).encode_frame(1)
    header = Header(at_ns // US, 9, 1, BROADCAST, 1, Kind.SCHEDULE, 8, 0, PRIORITY_CONTROL, FLAG_FLOOD)
    return Reception(header.encode() + inner, NodeId(1), at_ns, -60.0)


def test_without_swarm_time_no_schedule_reaches_a_node(make_scenario: MakeScenario) -> None:
    made = clocked(make_scenario)
    made.receive(NAMES.radio_rx(NodeId(2)), schedule(1 * S), 1 * S)
    report = made.report()
    assert report["clock"]["withheld"] == 1
    assert report["leader"] == 0
    exact = clocked(make_scenario, **{"clock.sync": "none"})
    exact.receive(NAMES.radio_rx(NodeId(2)), schedule(1 * S), 1 * S)
    assert exact.report()["leader"] == 1, "who takes its own clock for swarm time believes it"


def test_stamps_are_as_coarse_as_the_radio_s_clock(make_scenario: MakeScenario) -> None:
    made = clocked(make_scenario, **{"clock.timestamp_us": 50})
    stamps = {made._stamped_ns(1 * S + step * US) for step in range(1000)}
    assert len(stamps) in (20, 21)
    assert all(stamp_ns % (50 * US) == 0 for stamp_ns in stamps)


def test_swarm_time_as_a_node_is_told_it_never_goes_back(make_scenario: MakeScenario) -> None:
    """Its clock is found to be ahead when a reference with another time is followed."""
    made = clocked(make_scenario)
    shown = [made._advance_to(1 * S)]
    made._time._sync._fit.replace(made._time.line._replace(offset_ns=-20 * MS))  # type: ignore[attr-defined]
    shown += [made._advance_to(1 * S + step * MS) for step in range(0, 60, 5)]
    assert shown == sorted(shown)
    assert len(set(shown[:4])) == 1, "it stands still until swarm time has come up with it"
    assert shown[-1] > shown[0]


def test_what_it_announces_leaves_in_true_time(make_scenario: MakeScenario) -> None:
    made = clocked(make_scenario, **{"radio.lead_ms": 20, "clock.sync": "none", "traffic.arrivals": "none"})
    leads = []
    while len(leads) < 5:
        wake_ns = made.next_wake_ns()
        assert wake_ns is not None
        made.wake(wake_ns)
        leads += [message.start_ns - wake_ns for _, message in made.outbox if isinstance(message, TxRequest)]
        made.outbox.clear()
    assert all(abs(lead_ns - 20 * MS) <= 3 * US for lead_ns in leads), "whatever its own clock shows"


def test_the_end_of_a_frame_is_told_in_true_time_too(make_scenario: MakeScenario) -> None:
    made = clocked(make_scenario, **{"clock.offset_ms": 40, "clock.sync": "none"})
    shown_ns = made._time.line.swarm_ns(made._clock.local_ns(5 * S))
    asked = TxRequest(0, shown_ns, b"x", BROADCAST, wants_status=False, until_ns=shown_ns + 7 * MS)
    told = made._request(asked, 5 * S - 20 * MS)
    assert told.until_ns - told.start_ns == pytest.approx(7 * MS, abs=US)
    assert made._request(asked._replace(until_ns=0), 5 * S).until_ns == 0


@pytest.mark.parametrize("ahead_ms", [0, 5000])
def test_the_time_from_the_frame_to_the_application_is_true_time_while_swarm_time_stands_still(
    make_scenario: MakeScenario, ahead_ms: int
) -> None:
    made = clocked(make_scenario, **{"radio.handover_ms": 10})
    made._shown_ns = 1 * S + ahead_ms * MS  # as if its clock had been found to be ahead
    header = Header(0, 9, 1, BROADCAST, 1, Kind.DATA, 8, 0, PRIORITY_BULK, FLAG_FLOOD)
    frame = header.encode() + filler(100)
    made.receive(NAMES.radio_rx(NodeId(2)), Reception(frame, NodeId(1), 1 * S, -60.0), 1 * S + 7 * MS)
    (delivered,) = (record for record in made.records if isinstance(record, Delivered))
    assert (delivered.t_ns, delivered.handover_ns) == (1 * S + 7 * MS, 7 * MS)
