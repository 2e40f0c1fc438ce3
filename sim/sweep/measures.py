"""Measures of a run that are not in its summary; a sweep file names those it wants. Each is a
function of the outcome.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Final

import numpy as np

from agents.applications.traffic import sources_of, targets_of
from fanet_mw.errors import ConfigError
from fanet_mw.trace import Approaching, Detected
from fanet_mw.units import S
from sim.records.record_kinds import records_of
from sim.results.links_over_time import connectivity
from sim.results.outcome import Outcome
from sim.results.packets import AppPackets, first_class_of, packets_of, targets_by_source

Value = float | list[float] | None
_LEAST_S: Final = 1e-3
_PER_DECADE: Final = 40
_DECADES: Final = 6
DELAY_EDGES_S: Final = tuple(
    _LEAST_S * math.pow(10.0, step / _PER_DECADE) for step in range(_PER_DECADE * _DECADES + 1)
)
"""Upper edges of the classes of `delay_counts`: 40 per decade from 1 ms, below which is the first, to 1,000 s."""


def delay_counts(outcome: Outcome) -> list[float]:
    """Deliveries of application packets in each class of delay (`DELAY_EDGES_S`), and of all longer ones."""
    delays_s = first_class_of(outcome).deliveries.delay_ns / S
    counts = np.bincount(np.searchsorted(DELAY_EDGES_S, delays_s), minlength=len(DELAY_EDGES_S) + 1)
    return [float(count) for count in counts]


def wanted(outcome: Outcome) -> float:
    """The number of packets times their targets: the sum of `delay_counts` if nothing were lost."""
    return float(first_class_of(outcome).wanted)


def leader_pdr(outcome: Outcome) -> float | None:
    """The share of packets from other nodes to the leader, or to all nodes, that reached the leader."""
    leader, targets = outcome.scenario.leader, targets_by_source(outcome)
    meant = sum(origin != leader and leader in targets[origin] for origin, _ in first_class_of(outcome).sent)
    return len(_at_leader_s(outcome)) / meant if meant else None


def leader_delay_s(outcome: Outcome) -> float | None:
    """The mean delay of the packets that reached the leader [s]."""
    delays_s = _at_leader_s(outcome)
    return math.fsum(delays_s) / len(delays_s) if delays_s else None


def _at_leader_s(outcome: Outcome) -> list[float]:
    leader, found = outcome.scenario.leader, first_class_of(outcome).deliveries
    delays_s: list[float] = (found.delay_ns[found.node == leader] / S).tolist()
    return delays_s


def connected(outcome: Outcome) -> float:
    """The share of (source, target) pairs with a multi-hop path, on average over the measured window."""
    return connectivity(outcome.scenario)


def first_detected_s(outcome: Outcome) -> list[float]:
    """The instants at which UAVs first received a survivor's phone, for those that did [s]."""
    return _first_of_each(outcome, Detected)


def first_approach_s(outcome: Outcome) -> list[float]:
    """The instants at which UAVs first changed course towards a survivor, for those that did [s]."""
    return _first_of_each(outcome, Approaching)


def enough_heard_s(outcome: Outcome) -> float | None:
    """The instant [s] from which enough UAVs had received the same phone; none turns before it."""
    enough = outcome.scenario.mission.reports_to_approach
    who: dict[int, set[int]] = {}
    for record in records_of(outcome.records, Detected):
        heard = who.setdefault(record.survivor, set())
        heard.add(record.node)
        if len(heard) == enough:
            return record.t_ns / S
    return None


def _first_of_each(outcome: Outcome, kind: type[Approaching] | type[Detected]) -> list[float]:
    first: dict[int, int] = {}
    for record in records_of(outcome.records, kind):
        first.setdefault(record.node, record.t_ns)
    return sorted(t_ns / S for t_ns in first.values())


def age_s(outcome: Outcome) -> float | None:
    """The mean time [s] since the generation of the newest packet that a node has of another one, over the window of
    the traffic and all pairs (source, target). Before the first packet it counts as generated at the window's
    beginning. None if nobody sends.
    """
    start_ns, end_ns = outcome.scenario.traffic_window_ns
    heard = _heard_of(first_class_of(outcome))
    ages_s = [
        _age_area(heard.get((source, target), ()), start_ns, end_ns) / (end_ns - start_ns) / S
        for source in sources_of(outcome.scenario)
        for target in targets_of(outcome.scenario, source)
    ]
    return math.fsum(ages_s) / len(ages_s) if ages_s else None


def report_age_s(outcome: Outcome) -> float | None:
    """As `age_s`, of survivor reports, from a reporter's first to its last; None if no UAV has reported twice."""
    reports = packets_of(outcome)["report"]
    heard = _heard_of(reports)
    born_ns: dict[int, list[int]] = {}
    for (origin, _), packet in reports.sent.items():
        born_ns.setdefault(origin, []).append(packet.born_ns)
    area, length_ns = 0.0, 0
    for origin, instants_ns in born_ns.items():
        first_ns, last_ns = min(instants_ns), max(instants_ns)
        for node in outcome.scenario.node_ids:
            if node != origin:
                area += _age_area(heard.get((origin, node), ()), first_ns, last_ns)
                length_ns += last_ns - first_ns
    return area / length_ns / S if length_ns else None


def _heard_of(app: AppPackets) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """(arrival, generation) of each delivered packet by (origin, receiver), in the order of arrivals."""
    sent = [(origin, packet.born_ns) for (origin, _), packet in app.sent.items()]
    heard: dict[tuple[int, int], list[tuple[int, int]]] = {}
    columns = app.deliveries.packet.tolist(), app.deliveries.node.tolist(), app.deliveries.delay_ns.tolist()
    for packet, node, delay_ns in zip(*columns, strict=True):
        origin, born_ns = sent[packet]
        heard.setdefault((origin, node), []).append((born_ns + delay_ns, born_ns))
    for of_pair in heard.values():
        of_pair.sort()
    return heard


def _age_area(arrivals: Iterable[tuple[int, int]], start_ns: int, end_ns: int) -> float:
    """The integral of (now - latest generation) [ns^2], for pairs (arrival, generation) in the order of arrivals."""
    area, since_ns, latest_ns = 0.0, start_ns, start_ns
    for at_ns, born_ns in (*arrivals, (end_ns, end_ns)):
        until_ns = min(max(at_ns, start_ns), end_ns)
        area += (until_ns - since_ns) * ((since_ns + until_ns) / 2 - latest_ns)
        since_ns, latest_ns = until_ns, max(latest_ns, born_ns)
    return area


MEASURES: Final[Mapping[str, Callable[[Outcome], Value]]] = {
    "delay_counts": delay_counts,
    "wanted": wanted,
    "leader_pdr": leader_pdr,
    "leader_delay_s": leader_delay_s,
    "age_s": age_s,
    "report_age_s": report_age_s,
    "connected": connected,
    "first_detected_s": first_detected_s,
    "first_approach_s": first_approach_s,
    "enough_heard_s": enough_heard_s,
}


def check(names: Iterable[str]) -> None:
    """Raise ConfigError for a measure that does not exist."""
    for name in names:
        if name not in MEASURES:
            raise ConfigError(f"measure = {name!r}: must be one of {', '.join(MEASURES)}")
