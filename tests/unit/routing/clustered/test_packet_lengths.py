"""How long a packet of an application may be, by what its access has room for in every turn."""

from typing import Any

import pytest
from kit import MakeScenario

from fanet_mw.errors import LocalProtocolError
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.timetable.turn_size import schedule_bytes
from fanet_mw.units import BROADCAST, Enu, NodeId
from fanet_mw.wire import HEADER_BYTES, PRIORITY_BULK, PRIORITY_REPORT, PRIORITY_SAFETY, filler

REPORTS = {"mission.survivors": 2, "mission.report_bytes": 900}


def lengths(make_scenario: MakeScenario, relay: str, payload_bytes: int, **keys: Any) -> tuple[int, int]:
    """The greatest lengths of bulk and of reports; safety has no room of its own here."""
    keys = {"nodes.count": 5, "clusters.relay": relay, "traffic.payload_bytes": payload_bytes, **keys}
    node = Node(NodeId(2), make_scenario(**keys), make_protocol, position=Enu(0.0, 0.0, 50.0))
    bulk, report = node.most_packet_bytes(PRIORITY_BULK), node.most_packet_bytes(PRIORITY_REPORT)
    assert node.most_packet_bytes(PRIORITY_SAFETY) == bulk
    for priority, most in ((PRIORITY_BULK, bulk), (PRIORITY_REPORT, report)):
        with pytest.raises(LocalProtocolError, match=rf"packet of {most + 1} bytes must be <= {most}"):
            node.send(
                filler(most + 1 - HEADER_BYTES), destination=BROADCAST, priority=priority, app="", born_ns=0, now_ns=0
            )
    assert node.report()["waiting"] == 0
    return bulk, report


def test_in_a_timetable_bulk_has_the_room_of_traffic_or_of_a_schedule(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 5, "clusters.relay": "scheduled", "traffic.payload_bytes": 100}
    schedule = schedule_bytes(make_scenario(**keys))
    assert 300 < schedule < 600
    assert lengths(make_scenario, "scheduled", 100) == (schedule, schedule)
    assert lengths(make_scenario, "scheduled", 600) == (600, 600)


def test_in_a_timetable_reports_have_room_of_their_own(make_scenario: MakeScenario) -> None:
    assert lengths(make_scenario, "scheduled", 600, **REPORTS) == (600, 900)
    assert lengths(make_scenario, "scheduled", 1200, **REPORTS) == (1200, 1200)


@pytest.mark.parametrize("relay", ["all", "counter"])
def test_who_contends_sends_frames_of_any_length(make_scenario: MakeScenario, relay: str) -> None:
    assert lengths(make_scenario, relay, 100) == (2268, 2268)
