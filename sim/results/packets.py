"""The packets that applications sent, and their deliveries at the nodes for which they were meant.

A packet is identified by origin and sequence number. Only the first delivery at each target counts. A second one at the
same node is `repeated`: the node's process was restarted, and has forgotten the first. A delivered packet is `unknown`
if no node sent it at the instant that its header states: it is forged, or its origin's record is lost.
"""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from agents.applications.traffic import targets_of
from fanet_mw.trace import BoundStated, Delivered, Generated, LetOut, LikelyStated
from sim.run.collecting.record_kinds import records_of
from sim.run.outcome import Outcome

OTHER_APPS: Final = ("report", "warning")
"""The built-in applications that send packets, in addition to the traffic classes."""
Name = tuple[int, int]
"""The identity of a packet: (origin, sequence number)."""


@dataclass(frozen=True, slots=True)
class SentPacket:
    """One packet at its origin."""

    born_ns: int
    out_ns: int | None = None
    """The instant at which the packet's first frame could contend; None if the packet never left its origin."""
    bound_ns: int | None = None
    """The delay bound that the origin stated when it accepted the packet; None if it stated none."""
    likely: tuple[int, float] | None = None
    """The likely delay, and the share of copies that the origin stated to arrive within it; None if it stated none."""


@dataclass(slots=True)
class Deliveries:
    """The deliveries in columns of equal length, because an hour of a large swarm has millions of them."""

    packet: "array[int]" = field(default_factory=lambda: array("I"))
    """The index of the packet among those that its application sent."""
    node: "array[int]" = field(default_factory=lambda: array("H"))
    delay_ns: "array[int]" = field(default_factory=lambda: array("q"))
    handover_ns: "array[int]" = field(default_factory=lambda: array("q"))

    def __len__(self) -> int:
        return len(self.node)

    def add(self, packet: int, record: Delivered) -> None:
        self.packet.append(packet)
        self.node.append(record.node)
        self.delay_ns.append(record.delay_ns)
        self.handover_ns.append(record.handover_ns)


@dataclass(slots=True)
class AppPackets:
    """The packets of one application and their deliveries, of all nodes together."""

    sent: dict[Name, SentPacket] = field(default_factory=dict)
    """The packets by their identity, in the order of their generation."""
    wanted: int = 0
    """The sum over all packets of the number of nodes for which the packet was meant."""
    deliveries: Deliveries = field(default_factory=Deliveries)
    repeated: int = 0
    unknown: int = 0
    """The number of deliveries of unknown packets, whatever application they claimed; it is only counted for the first
    application."""


def packets_of(outcome: Outcome) -> Mapping[str, AppPackets]:
    """The packets by application: traffic classes, those of `OTHER_APPS`, then users' applications in the order of
    their first packets.

    The trace does not tell for which nodes a user's packet is meant, so `wanted` is 0 for users' applications.
    """
    classes = [*outcome.scenario.traffic_classes]
    found = {app: AppPackets() for app in (*classes, *OTHER_APPS)}
    app_of: dict[Name, tuple[AppPackets, int]] = {}  # with the index of the packet there
    meant_for: dict[Name, frozenset[int]] = {}  # the targets of each packet of the traffic
    targets = {name: targets_by_source(outcome, name) for name in classes}
    others = outcome.scenario.nodes.count - 1
    for born in records_of(outcome.records, Generated):
        app, name = found.setdefault(born.app, AppPackets()), (born.node, born.seq)
        app_of[name] = app, len(app.sent)
        app.sent[name] = SentPacket(born.t_ns)
        if born.app in targets:
            meant_for[name] = targets[born.app][born.node]
            app.wanted += len(targets[born.app][born.node])
        elif born.app in OTHER_APPS:
            app.wanted += others
    for known in records_of(outcome.records, LetOut, BoundStated, LikelyStated):
        # In real time it may come before the packet's own record, at one instant.
        name = known.node, known.seq
        if name in app_of:
            app, _ = app_of[name]
            app.sent[name] = _known(app.sent[name], known)
    had: dict[Name, int] = {}  # one bit per node: there are far fewer packets than deliveries
    exact = not outcome.scenario.clock.modelled  # otherwise the trace has true delays, whatever the header said
    for record in records_of(outcome.records, Delivered):
        name = record.origin, record.seq
        sender, place = app_of.get(name, (None, 0))
        if sender is None or (exact and record.t_ns - record.delay_ns != sender.sent[name].born_ns):
            found[classes[0]].unknown += 1
            continue
        wanted_by = meant_for.get(name)
        if record.node == record.origin or (wanted_by is not None and record.node not in wanted_by):
            continue
        before, bit = had.get(name, 0), 1 << record.node
        if before & bit:
            sender.repeated += 1
        else:
            had[name] = before | bit
            sender.deliveries.add(place, record)
    return found


def first_class_of(outcome: Outcome) -> AppPackets:
    """The first class of traffic."""
    return packets_of(outcome)[next(iter(outcome.scenario.traffic_classes))]


def _known(sent: SentPacket, record: LetOut | BoundStated | LikelyStated) -> SentPacket:
    match record:
        case LetOut():
            return replace(sent, out_ns=record.t_ns)
        case BoundStated():
            return replace(sent, bound_ns=record.bound_ns)
        case LikelyStated():
            return replace(sent, likely=(record.delay_ns, record.share))


def targets_by_source(outcome: Outcome, name: str | None = None) -> Mapping[int, frozenset[int]]:
    """For each node, the nodes for which its packets of a traffic class are meant; by default of the first class."""
    scenario = outcome.scenario
    return {node: frozenset(targets_of(scenario, node, name)) for node in scenario.node_ids}
