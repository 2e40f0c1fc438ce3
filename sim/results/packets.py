"""The packets that applications sent, and their deliveries at the nodes for which they were meant.

Only the first delivery at each target counts; a second one is `repeated`: the node's process was restarted. A packet is
`unknown` if no node sent one of its number, or with exact clocks none at the instant that its header states: it is
forged, or its origin's record is lost.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from agents.applications.traffic import targets_of
from fanet_mw.trace import BoundExcludes, BoundStated, Generated, LetOut, LikelyStated
from sim.records.record_kinds import Column, DeliveryColumns, delivery_columns, records_of
from sim.results.outcome import Outcome

OTHER_APPS: Final = ("report", "warning")
"""The built-in applications that send packets, in addition to the traffic classes."""
Name = tuple[int, int]
"""The identity of a packet: (origin, sequence number)."""
_EVERYONE: Final = 0
"""The row of the targets of packets that are meant for all nodes, or of which the trace does not tell the targets."""


class SentPacket(NamedTuple):
    """One packet at its origin."""

    born_ns: int
    out_ns: int | None = None
    """The instant at which the packet's first frame could contend; None if the packet never left its origin."""
    bound_ns: int | None = None
    """The delay bound that the origin stated when it accepted the packet; None if it stated none."""
    likely: tuple[int, float] | None = None
    """The likely delay, and the share of copies that the origin stated to arrive within it; None if it stated none."""
    targets: int = 0
    """The nodes for which it was meant, less those that its bound or likely delay excludes; 0 if the trace does not
    tell."""
    excluded: frozenset[int] = frozenset()
    """The nodes for which what its origin stated is not meant."""


class Deliveries(NamedTuple):
    """Deliveries in columns of equal length, because an hour of a large swarm has millions of them."""

    packet: Column
    """The index of the packet among those that its application sent."""
    node: Column
    delay_ns: Column
    handover_ns: Column

    @property
    def number(self) -> int:
        return len(self.node)


_NONE: Final = Deliveries(np.empty(0, np.uint32), np.empty(0, np.uint16), np.empty(0, np.int64), np.empty(0, np.int64))


class AppPackets:
    """The packets of one application and their deliveries, of all nodes together."""

    def __init__(self) -> None:
        self.sent: dict[Name, SentPacket] = {}
        """The packets by their identity, in the order of their generation."""
        self.wanted = 0
        """The sum over all packets of the number of nodes for which the packet was meant."""
        self.deliveries = _NONE
        """The first delivery of each packet at each node for which it was meant."""
        self.repeated = 0
        """Further deliveries there."""
        self.unknown = 0
        """Deliveries of unknown packets, whatever they claimed; counted for the first application only."""


def packets_of(outcome: Outcome) -> Mapping[str, AppPackets]:
    """The packets by application: traffic classes, those of `OTHER_APPS`, then users' in the order of their first
    packets, whose targets the trace does not tell (`wanted` is 0).
    """
    classes = [*outcome.scenario.traffic_classes]
    found = {app: AppPackets() for app in (*classes, *OTHER_APPS)}
    everyone = frozenset(outcome.scenario.node_ids)
    targets = [everyone]
    row_of: dict[tuple[str, int], int] = {}  # of the targets, by class and source
    for traffic_class in classes:
        for node, meant in targets_by_source(outcome, traffic_class).items():
            row_of[traffic_class, node] = len(targets)
            targets.append(meant)
    packets: dict[Name, _Known] = {}
    excluded: dict[Name, set[int]] = {}
    for record in records_of(outcome.records, BoundExcludes):
        excluded.setdefault((record.node, record.seq), set()).add(record.other)
    for name, app_name, sent in _sent(outcome):
        app = found.setdefault(app_name, AppPackets())
        row = row_of.get((app_name, name[0]), _EVERYONE)
        packets[name] = _Known(app_name, len(app.sent), sent.born_ns, row)
        copies = len(targets[row]) if row != _EVERYONE else len(everyone) - 1 if app_name in OTHER_APPS else 0
        without = targets[row].intersection(excluded.get(name, ()))
        app.sent[name] = sent._replace(targets=max(0, copies - len(without)), excluded=without)
        app.wanted += copies
    counting = _DeliveryCount(packets, list(found), targets, exact=not outcome.scenario.clock.modelled)
    for columns in delivery_columns(outcome.records):
        counting.take(columns)
    for app, deliveries, repeated in zip(found.values(), counting.deliveries(), counting.repeated, strict=True):
        app.deliveries, app.repeated = deliveries, int(repeated)
    found[classes[0]].unknown = counting.unknown
    return found


def _sent(outcome: Outcome) -> list[tuple[Name, str, SentPacket]]:
    """Each packet with its application, in the order of generation, and all that its origin stated; the first of two
    records counts. In real time a statement may come before the packet's own record.
    """
    born: dict[Name, Generated] = {}
    out_ns: dict[Name, int] = {}
    bound_ns: dict[Name, int] = {}
    likely: dict[Name, tuple[int, float]] = {}
    for record in records_of(outcome.records, Generated, LetOut, BoundStated, LikelyStated):
        name = record.node, record.seq
        match record:
            case Generated():
                born.setdefault(name, record)
            case LetOut():
                out_ns[name] = record.t_ns
            case BoundStated():
                bound_ns[name] = record.bound_ns
            case LikelyStated():
                likely[name] = record.delay_ns, record.share
    return [
        (name, one.app, SentPacket(one.t_ns, out_ns.get(name), bound_ns.get(name), likely.get(name)))
        for name, one in born.items()
    ]


class _Known(NamedTuple):
    """What must be known of a packet to count its deliveries."""

    app: str
    place: int
    """The index of the packet among those that its application sent."""
    born_ns: int
    targets: int
    """The row of the nodes for which the packet is meant."""


class _DeliveryCount:
    """Counts the deliveries of known packets, portion by portion. Packets are numbered in the order of their
    generation; -1, an unknown one, finds the last row of each column, which belongs to no packet.
    """

    def __init__(
        self, packets: Mapping[Name, _Known], apps: list[str], targets: list[frozenset[int]], *, exact: bool
    ) -> None:
        """`exact`: clocks are exact, so the delay of a delivery tells when its packet was generated."""
        number_of_app = {name: number for number, name in enumerate(apps)}
        known = [*packets.values(), _Known(apps[0], 0, -1, _EVERYONE)]
        self._exact = exact
        self._numbers = {name: number for number, name in enumerate(packets)}
        self._app = np.array([number_of_app[one.app] for one in known])
        self._place = np.array([one.place for one in known], np.uint32)
        self._born_ns = np.array([one.born_ns for one in known])
        self._row = np.array([one.targets for one in known])
        width = max(targets[_EVERYONE]) + 1
        self._meant = np.zeros((len(targets), width), bool)
        for row, nodes in enumerate(targets):
            self._meant[row, list(nodes)] = True
        self._had = np.zeros(len(packets) * width, bool)
        """For each packet and node, whether a delivery was counted."""
        self._found: list[list[Deliveries]] = [[] for _ in apps]
        self.repeated: npt.NDArray[np.int64] = np.zeros(len(apps), np.int64)
        """The number of repeated deliveries of each application."""
        self.unknown = 0

    def take(self, columns: DeliveryColumns) -> None:
        names = zip(columns.origin.tolist(), columns.seq.tolist(), strict=True)
        packet = np.array([self._numbers.get(name, -1) for name in names], np.int64)
        known = packet >= 0
        if self._exact:
            known &= columns.t_ns - columns.delay_ns == self._born_ns[packet]
        self.unknown += len(known) - int(known.sum())
        width = self._meant.shape[1]
        chosen = known & (columns.node != columns.origin) & (columns.node >= 0) & (columns.node < width)
        chosen[chosen] = self._meant[self._row[packet[chosen]], columns.node[chosen]]
        packet, node = packet[chosen], columns.node[chosen].astype(np.int64)
        first = self._first(packet * width + node)
        app = self._app[packet]
        self.repeated += np.bincount(app[~first], minlength=len(self.repeated))
        packet, node, app = packet[first], node[first], app[first]
        delay_ns, handover_ns = columns.delay_ns[chosen][first], columns.handover_ns[chosen][first]
        for number in np.unique(app):
            of_app = app == number
            self._found[number].append(
                Deliveries(
                    self._place[packet[of_app]], node[of_app].astype(np.uint16), delay_ns[of_app], handover_ns[of_app]
                )
            )

    def _first(self, pairs: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """For each pair of packet and node, whether it comes for the first time."""
        first = np.zeros(len(pairs), bool)
        first[np.unique(pairs, return_index=True)[1]] = True
        first &= ~self._had[pairs]
        self._had[pairs] = True
        return first

    def deliveries(self) -> list[Deliveries]:
        return [
            Deliveries(*map(np.concatenate, zip(*portions, strict=True))) if portions else _NONE
            for portions in self._found
        ]


def first_class_of(outcome: Outcome) -> AppPackets:
    return packets_of(outcome)[next(iter(outcome.scenario.traffic_classes))]


def targets_by_source(outcome: Outcome, name: str | None = None) -> Mapping[int, frozenset[int]]:
    """For each node, the nodes for which its packets of a traffic class are meant; by default of the first class."""
    scenario = outcome.scenario
    return {node: frozenset(targets_of(scenario, node, name)) for node in scenario.node_ids}
