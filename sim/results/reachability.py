"""What an ideal flood could have delivered: without collisions, queues and airtimes, over the links as they were.

    reached   the nodes of the origin's part of the network when the packet is born; then, second by second, of every
              part that holds one of them (time-respecting paths: a node keeps what it has), until its lifetime is over

What was delivered was reachable, whatever geometry says. Packets whose lifetime was not over at the end are left out.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from fanet_mw.scenario import Scenario
from fanet_mw.units import S
from fanet_mw.wire import PRIORITIES, PRIORITY_REPORT, PRIORITY_SAFETY
from sim.results.links_over_time import LinksOverTime, parts
from sim.results.outcome import Outcome
from sim.results.packets import OTHER_APPS, AppPackets, targets_by_source
from sim.world.arrays import Flags


def reachability(outcome: Outcome, applications: Mapping[str, AppPackets], links: LinksOverTime) -> dict[str, Any]:
    """The table `reachable` of `summary.json`: for each built-in application that sent packets."""
    flood = _IdealFlood(links)
    return {
        name: _held_against(outcome, name, app, flood)
        for name, app in applications.items()
        if app.sent and (name in outcome.scenario.traffic_classes or name in OTHER_APPS)
    }


def _lifetime_ns(scenario: Scenario, name: str) -> int:
    own = {"warning": PRIORITY_SAFETY, "report": PRIORITY_REPORT}
    priority = own[name] if name in own else PRIORITIES[scenario.traffic_classes[name].priority]
    return scenario.routing.lifetime_ns(priority)


def _held_against(outcome: Outcome, name: str, app: AppPackets, flood: "_IdealFlood") -> dict[str, Any]:
    lifetime_ns, ended_ns = _lifetime_ns(outcome.scenario, name), outcome.simulated_ns
    packets = list(app.sent.items())
    over = np.array([sent.born_ns + lifetime_ns <= ended_ns for _, sent in packets])
    bounds_ns = np.array([-1 if sent.bound_ns is None else sent.bound_ns for _, sent in packets], np.int64)
    meant = _meant(outcome, name, packets)
    came = np.zeros_like(meant)
    came[app.deliveries.packet, app.deliveries.node] = True
    wanted = int(meant[over].sum())
    if not wanted:  # all were born too late
        return {"packets": 0, "left_out": len(packets), "share": None, "pdr": None, "within_share": None}
    born_ns = np.array([sent.born_ns for _, sent in packets], np.int64)
    origins = np.array([origin for (origin, _), _ in packets], np.int64)
    reached = came | (meant & flood.reached(origins, born_ns, born_ns + lifetime_ns, chosen=over))
    promised = over & (bounds_ns >= 0)
    in_time = np.zeros_like(meant)
    prompt = app.deliveries.delay_ns <= bounds_ns[app.deliveries.packet]
    in_time[app.deliveries.packet[prompt], app.deliveries.node[prompt]] = True
    soon = in_time | (meant & flood.reached(origins, born_ns, born_ns + bounds_ns, chosen=promised))
    return {
        "packets": int(over.sum()),
        "left_out": len(packets) - int(over.sum()),
        "share": _ratio(int(reached[over].sum()), wanted),
        "pdr": _ratio(int(came[over].sum()), int(reached[over].sum())),
        "within_share": _ratio(int(in_time[promised].sum()), int(soon[promised].sum())),
    }


def _ratio(part: int, whole: int) -> float | None:
    return round(part / whole, 6) if whole else None


def _meant(outcome: Outcome, name: str, packets: list[Any]) -> Flags:
    """For each packet, the nodes for which it is meant, by node id."""
    count = outcome.scenario.node_count
    targets = targets_by_source(outcome, name) if name in outcome.scenario.traffic_classes else {}
    rows: dict[int, Flags] = {}
    for node in outcome.scenario.node_ids:
        row = rows[node] = np.zeros(count + 1, bool)
        row[list(targets.get(node, outcome.scenario.node_ids))] = True
        row[node] = False
    return np.array([rows[origin] for (origin, _), _ in packets])


class _IdealFlood:
    """The nodes that an ideal flood reaches, by origin and interval."""

    def __init__(self, links: LinksOverTime) -> None:
        self._links = links
        self._parts: dict[int, npt.NDArray[np.int64]] = {}

    def reached(
        self, origins: npt.NDArray[np.int64], from_ns: npt.NDArray[np.int64], until_ns: npt.NDArray[np.int64], *,
        chosen: Flags,
    ) -> Flags:  # fmt: skip
        """For each of the chosen packets, the nodes reached from the first to the last instant, by node id."""
        count = len(self._links.at(0))
        found = np.zeros((len(origins), count + 1), bool)
        by_second: dict[int, list[int]] = defaultdict(list)
        for packet in np.flatnonzero(chosen).tolist():
            by_second[int(from_ns[packet]) // S].append(packet)
        for first, packets in by_second.items():
            last = {packet: min(int(until_ns[packet]) // S, self._links.seconds - 1) for packet in packets}
            ends: dict[int, list[int]] = defaultdict(list)
            for packet in packets:
                ends[max(first, last[packet])].append(packet)
            for second, reached in self._spread(first, max(ends)):
                for packet in ends.pop(second, ()):
                    found[packet, 1:] = reached[origins[packet] - 1]
        return found

    def _spread(self, first: int, last: int) -> Iterator[tuple[int, Flags]]:
        """Each second, and for each origin [rows] the nodes that a flood begun in the first one has reached in it."""
        reached = np.eye(len(self._links.at(0)), dtype=bool)
        before: npt.NDArray[np.int64] | None = None
        for second in range(first, last + 1):
            part = self._part(second)
            if part is not before and not reached.all():
                members = np.zeros((len(part), int(part.max()) + 1), np.float32)
                members[np.arange(len(part)), part] = 1
                reached = ((reached.astype(np.float32) @ members > 0).astype(np.float32) @ members.T) > 0
            before = part
            yield second, reached

    def _part(self, second: int) -> npt.NDArray[np.int64]:
        """The part of the network to which each node belongs; one array while nothing changes."""
        part = self._parts.get(second)
        if part is None:
            links = self._links.at(second)
            if second - 1 in self._parts and links is self._links.at(second - 1):
                part = self._parts[second - 1]
            else:
                part = np.unique(parts(links), return_inverse=True)[1].reshape(-1)
            self._parts[second] = part
        return part
