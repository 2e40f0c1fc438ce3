"""The age of information: how old the newest packet is that a node has of another one, on average over time."""

import math
from collections.abc import Iterable

from agents.applications.traffic import sources_of, targets_of
from fanet_mw.units import S
from sim.results.outcome import Outcome
from sim.results.packets import AppPackets, first_class_of, packets_of


def age_s(outcome: Outcome) -> float:
    """The mean time [s] since the generation of the newest packet that a node has of another one, over the window of
    the traffic and all pairs (source, target). Before the first packet it counts as generated at the window's
    beginning.
    """
    start_ns, end_ns = outcome.scenario.traffic_window_ns
    heard = _heard_of(first_class_of(outcome))
    ages_s = [
        _age_area(heard.get((source, target), ()), start_ns, end_ns) / (end_ns - start_ns) / S
        for source in sources_of(outcome.scenario)
        for target in targets_of(outcome.scenario, source)
    ]
    return math.fsum(ages_s) / len(ages_s) if ages_s else 0.0


def report_age_s(outcome: Outcome) -> float | None:
    """The same of survivor reports, over all pairs of UAVs and from a reporter's first report to its last; None if no
    UAV has reported twice.
    """
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
