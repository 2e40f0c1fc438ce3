"""How large the frames of a timetable are, and so how long its turns, and how many a superframe holds.

Each turn reserves room for one packet of each urgent class that the scenario uses: a collision warning, a survivor
report, whose lengths are known before take-off. `turn_release.py` fills the room.
"""

import math
from collections.abc import Mapping
from typing import Final

from fanet_mw import wire
from fanet_mw.routing.clustered.roles.position_updates import STRAYED, UNLIKE
from fanet_mw.routing.clustered.tdma.turn_timing import Turns, turn_ns
from fanet_mw.routing.clustered.timetable.interference import Geometry
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, seconds_to_ns
from fanet_mw.wire import DIGEST, HEADER_BYTES, LINKS, LOADS, OVERHEAD, PLACES, SCHEDULE
from fanet_mw.wire.hello.digest import CAPACITY as DIGEST_CAPACITY
from fanet_mw.wire.links import MESSAGES
from fanet_mw.wire.places import CAPACITY as PLACES_CAPACITY
from fanet_mw.wire.schedule import CAPACITY

WARNING_BYTES: Final = wire.HEADER_BYTES + 19 + wire.OVERHEAD
"""MAVLink's COLLISION has 19 bytes (common.xml)."""
_REPORT_BYTES: Final = wire.HEADER_BYTES + wire.SURVIVOR.layout.size + wire.OVERHEAD


def report_bytes(scenario: Scenario) -> int:
    """The length of a packet with a survivor report."""
    return scenario.mission.report_bytes or _REPORT_BYTES


def reserved(scenario: Scenario) -> Mapping[int, int]:
    """Bytes of each turn that bulk must leave free, by priority: one packet of each urgent class in use."""
    found = {}
    if scenario.mission.collision_horizon_s:
        found[wire.PRIORITY_SAFETY] = WARNING_BYTES
    if scenario.mission.survivors:
        found[wire.PRIORITY_REPORT] = report_bytes(scenario)
    return found


_AVERAGED: Final = 0.02
"""The greatest error of a reported position along each axis, as a share of the radio range; it is a little less."""
_UNSURE: Final = 0.05
"""The share of the range at whose end a link may not be there, because positions have errors."""
_ROUNDING_M: Final = 1.5
_SCHEDULE_BYTES: Final = SCHEDULE.layout.size + OVERHEAD
_PLACES_BYTES: Final = PLACES.layout.size + OVERHEAD
_MOST_DIGESTS: Final = 4
_HELLO_BYTES: Final = 200
_MOST_PERIODS: Final = 4
"""The greatest length of a superframe with measured links, in flooding periods."""
LOAD: Final = 0.9
"""The share of a node's root turns that its packets use with measured links; its other messages need the rest."""


def largest_frame(scenario: Scenario, *, together: int = 1) -> int:
    """The largest frame of a turn: bulk and reserved room, or an announcement."""
    links_bytes = HEADER_BYTES + MESSAGES * (LINKS.layout.size + OVERHEAD) if scenario.measures_links else 0
    longest = max(together * scenario.traffic.payload_bytes, schedule_bytes(scenario), links_bytes)
    return longest + sum(reserved(scenario).values())


def most_packet_bytes(scenario: Scenario, priority: int) -> int:
    """The longest packet that each turn has room for, whatever the timetable, in bulk's or its class's room."""
    urgent = reserved(scenario)
    return max(largest_frame(scenario) - sum(urgent.values()), urgent.get(priority, 0))


def schedule_bytes(scenario: Scenario) -> int:
    """The size of a part of a schedule with its positions."""
    members = min(scenario.node_count, CAPACITY)
    loads_bytes = LOADS.layout.size + OVERHEAD if scenario.hears_load else 0
    return HEADER_BYTES + _SCHEDULE_BYTES + _PLACES_BYTES * -(-members // PLACES_CAPACITY) + loads_bytes


def superframe(scenario: Scenario, *, origin_ns: int = 0, period_ns: int | None = None, together: int = 1) -> Turns:
    turn = turn_ns(scenario, payload_bytes=largest_frame(scenario, together=together))
    whole_ns = scenario.clusters.period_ns if period_ns is None else period_ns
    contention_ns = round(scenario.clusters.contention_ms * MS)
    return Turns(origin_ns, whole_ns, contention_ns, turn, max(0, whole_ns - contention_ns) // turn)


def links(scenario: Scenario, turns: Turns) -> Geometry:
    clusters, radio = scenario.clusters, scenario.radio
    wait_ns = radio.lead_ns + radio.handover_ns
    by = tuple(sorted(scenario.reaches.items()))
    return Geometry(
        link_m=clusters.link_m or radio.range_m,
        interference_m=clusters.interference_m
        or (_disturbed_m(scenario) if radio.channel == "range" else 2 * radio.range_m),
        margin_m=0.0 if clusters.link_m else _UNSURE * radio.range_m,
        turns=turns.per_superframe,
        hop_turns=1 + -(-wait_ns // turns.turn_ns),
        links_by=by if radio.channel == "range" else (),  # on others links grow less with a gain than in free space
        interference_by=by,
    )


def _disturbed_m(scenario: Scenario) -> float:
    """The greatest reported distance at which nodes may disturb each other with `radio.channel = "range"`: the range,
    the error of GPS, and how far both may have strayed from extrapolated positions (`STRAYED`, `UNLIKE`).
    """
    range_m, mobility = scenario.radio.range_m, scenario.mobility
    strayed = 0.0 if mobility.model == "static" else UNLIKE if mobility.rigid else STRAYED
    strayed_m = 2 * strayed * (scenario.clusters.link_m or range_m)
    return range_m + distance_error_m(scenario) + strayed_m


def distance_error_m(scenario: Scenario) -> float:
    """How far true and reported distances may differ: four deviations of averaged GPS fixes, and whole metres."""
    noise_m = min(scenario.world.gps_sigma_m, _AVERAGED * scenario.radio.range_m)
    return 4 * math.sqrt(2) * math.hypot(noise_m, scenario.sensors.gps_bias_m) + _ROUNDING_M


def measured_period_ns(scenario: Scenario) -> int:
    """The superframe with measured links: a little less than the packets of a source take, 1 to 4 flooding periods, so
    that there is room for repetitions.
    """
    one_each_ns = int(LOAD * seconds_to_ns(scenario.traffic.interval_s))
    return max(scenario.clusters.period_ns, min(_MOST_PERIODS * scenario.clusters.period_ns, one_each_ns))


def hello_bytes(scenario: Scenario) -> int:
    digests = min(_MOST_DIGESTS, -(-scenario.node_count // DIGEST_CAPACITY))
    return HEADER_BYTES + _HELLO_BYTES + digests * (DIGEST.layout.size + OVERHEAD)


def most_together(scenario: Scenario) -> int:
    """The greatest number of bulk packets that fit into a frame besides the reserved room."""
    room = scenario.radio.max_frame_bytes - sum(reserved(scenario).values())
    return max(1, room // scenario.traffic.payload_bytes)


def schedule_parts(scenario: Scenario) -> int:
    """The number of turns that the leader's schedules take in each superframe."""
    return max(1, -(-(scenario.node_count - 1) // CAPACITY))
