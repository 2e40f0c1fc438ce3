"""The load of a swarm: the traffic classes that follow from a scenario.

Each class is periodic at each source. Warnings are counted as one conflict per UAV at a time, survivor reports as one
detected survivor per UAV; a UAV that detects two at once reports twice as often. Saturated sources have no period, and
Poisson arrivals no least interval, so neither can be planned.
"""

from collections.abc import Sequence
from typing import NamedTuple

from fanet_mw import wire
from fanet_mw.bounds import Bounded, DelayBound, Refused
from fanet_mw.routing.clustered.timetable.turn_size import WARNING_BYTES, report_bytes
from fanet_mw.scenario import Scenario, Traffic
from fanet_mw.units import NodeId, seconds_to_ns


class TrafficClass(NamedTuple):
    """Packets of `payload_bytes` (UDP payload on the air), one per source and interval."""

    name: str
    payload_bytes: int
    interval_ns: int
    sources: tuple[NodeId, ...]
    priority: int = wire.PRIORITY_BULK

    @property
    def per_second(self) -> float:
        return len(self.sources) * 1e9 / self.interval_ns


class ClassPlan(NamedTuple):
    """The plan of a traffic class: its delay bound from the source to the last node, and from the head on."""

    name: str
    sources: int
    interval_ns: int
    bound: DelayBound
    from_head: DelayBound
    priority: int = wire.PRIORITY_BULK

    def meets(self, deadline_ns: int) -> bool:
        return isinstance(self.bound, Bounded) and self.bound.delay_ns <= deadline_ns


def demands(scenario: Scenario, sources: Sequence[NodeId] | None = None) -> list[TrafficClass] | Refused:
    """The classes, most urgent first; by default, all nodes that may send the application's traffic are its sources."""
    found = []
    if scenario.mission.collision_horizon_s:
        interval_ns = seconds_to_ns(scenario.mission.collision_repeat_s)
        found.append(TrafficClass("warning", WARNING_BYTES, interval_ns, _all(scenario), wire.PRIORITY_SAFETY))
    if scenario.mission.survivors:
        interval_ns = seconds_to_ns(scenario.mission.report_interval_s)
        found.append(TrafficClass("report", report_bytes(scenario), interval_ns, _all(scenario), wire.PRIORITY_REPORT))
    for name, traffic in scenario.traffic_classes.items():
        first = traffic is scenario.traffic
        if traffic.arrivals in ("saturated", "poisson", "trace"):
            return Refused(
                f'traffic.arrivals = "{traffic.arrivals}" has no least interval, so nothing bounds its delay'
            )
        who = _eligible(scenario, traffic) if sources is None or not first else tuple(sorted(sources))
        if traffic.arrivals != "none" and who:
            interval_ns, priority = seconds_to_ns(traffic.interval_s), wire.PRIORITIES[traffic.priority]
            label = "application" if first else name
            found.append(TrafficClass(label, traffic.payload_bytes, interval_ns, who, priority))
    return sorted(found, key=lambda demand: demand.priority)


def _all(scenario: Scenario) -> tuple[NodeId, ...]:
    return tuple(NodeId(n) for n in scenario.node_ids)


def _eligible(scenario: Scenario, traffic: Traffic) -> tuple[NodeId, ...]:
    """The nodes that may be sources: of a number the lowest ids, the leader only if the others are too few."""
    if isinstance(traffic.sources, tuple):
        return tuple(NodeId(n) for n in sorted(set(traffic.sources)))
    candidates = tuple(n for n in _all(scenario) if n != traffic.destination)
    if traffic.sources == "all":
        return candidates
    members = tuple(n for n in candidates if n != scenario.leader)
    return (members if traffic.sources <= len(members) else candidates)[: traffic.sources]
