"""Which packets the applications sent, and which of them arrived where they were meant to: once per node and packet.

A packet is named by its origin and sequence number. A delivery counts where the packet was meant for the node; a second
one at the same node is `repeated`: its process has started again, and has forgotten what it had. What nobody sent, or
nobody sent at the instant that its header claims, is `unknown` and no delivery: forged, or its origin's record is lost.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from agents.traffic import targets_of
from fanet_mw.trace import BoundStated, Delivered, Generated, LetOut, LikelyStated
from sim.run.outcome import Outcome

APPS: Final = ("traffic", "report", "warning")
Name = tuple[int, int]
"""(origin, sequence number)."""


@dataclass(frozen=True, slots=True)
class Sent:
    """One packet at its origin."""

    born_ns: int
    out_ns: int | None = None
    """When its first frame could contend; None: it never left."""
    bound_ns: int | None = None
    """The delay that its origin promised when it accepted the packet; None: it promised none."""
    likely: tuple[int, float] | None = None
    """The delay within which its origin said that at least this share of its copies arrive; None: it said nothing."""


@dataclass(slots=True)
class Application:
    """What became of the packets of one application, all nodes together."""

    sent: dict[Name, Sent] = field(default_factory=dict)
    wanted: int = 0
    """Packets times the nodes that each was meant for."""
    deliveries: list[Delivered] = field(default_factory=list)
    repeated: int = 0
    unknown: int = 0
    """Deliveries of packets that no application is known to have sent, whatever they claimed: counted once, here with
    the first application."""


def packets_of(outcome: Outcome) -> Mapping[str, Application]:
    """By application: those of `APPS`, then those of users in the order in which they began to send.

    To which nodes a packet of a user's application is meant to go is not in the trace: its `wanted` stays 0.
    """
    found = {app: Application() for app in APPS}
    app_of: dict[Name, Application] = {}
    targets = targets_by_source(outcome)
    others = outcome.scenario.nodes.count - 1
    for record in outcome.records:
        if type(record) is Generated:
            app = app_of[record.node, record.seq] = found.setdefault(record.app, Application())
            app.sent[record.node, record.seq] = Sent(record.t_ns)
            if record.app in APPS:
                app.wanted += len(targets[record.node]) if record.app == "traffic" else others
    had: set[tuple[int, int, int]] = set()
    exact = not outcome.scenario.clock.modelled  # else delays are true ones, whatever the header said
    for record in outcome.records:
        # In real time it may come before the packet's own record, at one instant.
        if isinstance(record, LetOut | BoundStated | LikelyStated):
            name = record.node, record.seq
            if name in app_of:
                app_of[name].sent[name] = _known(app_of[name].sent[name], record)
        if type(record) is not Delivered:
            continue
        sender = app_of.get((record.origin, record.seq))
        if sender is None or (
            exact and record.t_ns - record.delay_ns != sender.sent[record.origin, record.seq].born_ns
        ):
            found[APPS[0]].unknown += 1
            continue
        if not _is_target(record, sender is found["traffic"], targets):
            continue
        delivery = record.node, record.origin, record.seq
        if delivery in had:
            sender.repeated += 1
        else:
            had.add(delivery)
            sender.deliveries.append(record)
    return found


def _known(sent: Sent, record: LetOut | BoundStated | LikelyStated) -> Sent:
    match record:
        case LetOut():
            return replace(sent, out_ns=record.t_ns)
        case BoundStated():
            return replace(sent, bound_ns=record.bound_ns)
        case LikelyStated():
            return replace(sent, likely=(record.delay_ns, record.share))


def targets_by_source(outcome: Outcome) -> Mapping[int, frozenset[int]]:
    """Of every node, the nodes that its traffic is meant for."""
    scenario = outcome.scenario
    return {node: frozenset(targets_of(scenario, node)) for node in scenario.node_ids}


def _is_target(delivered: Delivered, is_traffic: bool, targets: Mapping[int, frozenset[int]]) -> bool:
    """Whether the packet was meant for this node; reports and warnings are meant for all but their origin."""
    if is_traffic:
        return delivered.node in targets[delivered.origin]
    return delivered.node != delivered.origin
