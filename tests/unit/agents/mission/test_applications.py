"""What a UAV of a planned search believes of what it receives about survivors, and what it passes on."""

from collections.abc import Callable
from typing import Any
from unittest.mock import Mock

import pytest

from agents.mission.applications import PlannedSearch
from fanet_mw.application import Received
from fanet_mw.errors import MalformedFrameError
from fanet_mw.mavlink import Encoder
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, Enu, NodeId, S
from fanet_mw.wire import HEADER_BYTES, PRIORITY_CONTROL, PRIORITY_REPORT, Header, Kind
from fanet_mw.wire.search_messages import told_in
from fanet_mw.wire.survivors import Found, Standing, Survivor

OURS, THEIRS = NodeId(1), NodeId(2)
NOW_NS = 50 * S
HALF_M = 500.0
REPORT = Survivor(NOW_NS // US, 3, THEIRS, Enu(100.0, 0.0, 65.0), -80.0)
CONFIRMED = Found(NOW_NS // US, 3, 100.0, 0.0, 4.0, 0.0, 4.0, THEIRS, Standing.CONFIRMED)
IMPOSSIBLE = {
    "a report of the future": REPORT._replace(t_us=(NOW_NS + S + MS) // US),
    "a report of the last day": REPORT._replace(t_us=(1 << 62) // US),
    "a phone stronger than any": REPORT._replace(rssi_dbm=12.0),
    "a reporter too far to the east": REPORT._replace(position=Enu(30_000.0, 0.0, 65.0)),
    "a reporter too far to the south": REPORT._replace(position=Enu(0.0, -30_000.0, 65.0)),
    "a confirmation of the future": CONFIRMED._replace(t_us=(NOW_NS + S + MS) // US),
    "a refutation of the future": CONFIRMED._replace(t_us=(1 << 62) // US, standing=Standing.REFUTED),
    "a survivor to the west of the area": CONFIRMED._replace(east_m=-HALF_M - 101),
    "an estimate to the north of the area": CONFIRMED._replace(north_m=HALF_M + 101, standing=Standing.ESTIMATED),
}
POSSIBLE = {
    "a report": REPORT,
    "a clock that is a little ahead": REPORT._replace(t_us=(NOW_NS + S) // US),
    "a phone right beside its receiver": REPORT._replace(rssi_dbm=5.0),
    "a receiver at its base beside the area": REPORT._replace(position=Enu(0.0, -HALF_M - 130, 1.0)),
    "a confirmation": CONFIRMED,
    "a place at the edge, on a slope": CONFIRMED._replace(north_m=HALF_M + 30),
}


@pytest.fixture
def search(make_scenario: Callable[..., Scenario]) -> PlannedSearch:
    keys = {"nodes.count": 20, "mission.search": "lines", "mobility.model": "onboard", "world.area_m": 2 * HALF_M}
    made = PlannedSearch(make_scenario(**keys), OURS, position=Enu(0.0, 0.0, 65.0))
    made.start(Mock(node=OURS, position=Enu(0.0, 0.0, 65.0)), 0)
    return made


def hello(told: Any) -> bytes:
    """A hello of the other UAV that passes on a message."""
    header = Header(NOW_NS // US, 0x8000_0000, THEIRS, BROADCAST, THEIRS, Kind.HELLO, 1, 0, PRIORITY_CONTROL, 0)
    position = Encoder(THEIRS).global_position(Enu(90.0, 0.0, 65.0), Enu(0.0, 0.0, 0.0), yaw=None, now_ns=NOW_NS)
    return header.encode() + position + bytes(told.encode_frame(THEIRS))


def passed_on(search: PlannedSearch) -> list[Any]:
    return list(told_in(bytes(HEADER_BYTES) + search.hello_frames(NOW_NS + S)))


@pytest.mark.parametrize("told", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_what_cannot_be_is_neither_believed_nor_passed_on(search: PlannedSearch, told: Survivor | Found) -> None:
    search.on_hello(hello(told), NOW_NS)
    frame = bytes(HEADER_BYTES) + told.encode_frame(THEIRS)
    with pytest.raises(MalformedFrameError):
        search.on_message(Received(THEIRS, BROADCAST, PRIORITY_REPORT, NOW_NS, 1, frame), NOW_NS)
    assert passed_on(search) == []
    search.on_hello(hello(REPORT), NOW_NS)
    assert passed_on(search) == [REPORT], "the next report is the newest"


@pytest.mark.parametrize("told", POSSIBLE.values(), ids=POSSIBLE)
@pytest.mark.parametrize("flooded", [False, True])
def test_what_may_be_is_passed_on(search: PlannedSearch, told: Survivor | Found, flooded: bool) -> None:
    if flooded:
        frame = bytes(HEADER_BYTES) + told.encode_frame(THEIRS)
        search.on_message(Received(THEIRS, BROADCAST, PRIORITY_REPORT, NOW_NS, 1, frame), NOW_NS)
    else:
        search.on_hello(hello(told), NOW_NS)
    assert passed_on(search) == [told]
