"""A plan as lines of text. Each figure has its unit, and the text says which figures are not proven."""

import textwrap
from collections.abc import Iterator, Sequence
from typing import Final

from agents.ground_control.telemetry_pace import pace_of
from fanet_mw.bounds import Bounded, DelayBound, Refused
from fanet_mw.scenario import Scenario
from fanet_mw.trace import LIKELY_SHARE
from fanet_mw.units import MS, S
from sim.planner.cheapest_change import ScenarioChange
from sim.planner.demand import ClassPlan
from sim.planner.flood_loss import Loss
from sim.planner.head_slot import ClusterPlan
from sim.planner.lossy_plan import Drawn, LossyPlan
from sim.planner.scenario_plan import ScenarioPlan
from sim.planner.timetable_plan import TimetablePlan

_SHOWN: Final = 8
"""The greatest number of heads that are listed, the fullest first."""
_WIDTH: Final = 100
_LABEL: Final = 14


def describe(found: ScenarioPlan | Refused) -> str:
    return f"cannot be planned: {found.reason}" if isinstance(found, Refused) else "\n".join(_lines(found))


def describe_loss(found: Loss | None, *, everyone: bool) -> str:
    """`everyone`: nothing but such a loss keeps packets from any node."""
    if found is None:
        return item("loss", "no probability: shadowing, fading and obstacles spoil links for longer than a frame")
    if not found.worst:
        return item("loss", "none in this channel" + (": every packet reaches everyone" if everyone else ""))
    return item(
        "loss",
        f"a packet misses a node with probability {found.mean:.2g} at most on average, {found.worst:.2g} at worst "
        f"(node {found.root} to node {found.node}), repairs not counted",
    )


def describe_not_counted(sentences: Sequence[str]) -> str:
    return "\n".join(item("not counted" if index == 0 else "", said) for index, said in enumerate(sentences))


def describe_lossy(found: LossyPlan) -> str:
    scenario = found.scenario
    lines = [
        f"{'FEASIBLE' if found.feasible else 'NOT FEASIBLE'}  {scenario.name}: {scenario.node_count} nodes, "
        "floods repeated over lossy links",
        *(item("problem", problem) for problem in found.problems),
        item("bound", "none: a packet may be lost for good"),
    ]
    for number, drawn in enumerate(found.draws, start=1):
        label = "likely" if number == 1 else ""
        swarm = f" (draw {number} of {len(found.draws)})" if len(found.draws) > 1 else ""
        lines.append(item(label, _likely(drawn) + swarm))
    fitted = next((drawn.fitted for drawn in found.draws if drawn.fitted is not None), None)
    if fitted is not None:
        lines += _superframe(
            TimetablePlan(fitted.turns, fitted.table.used, len(fitted.table.roots()), fitted.table, fitted.together)
        )
    return "\n".join([*lines, *(item("note", note) for note in found.notes)])


def _likely(drawn: Drawn) -> str:
    if not drawn.known_ns:
        return "no source states a delay"
    known_ns, share = drawn.known_ns, f"{LIKELY_SHARE:g} of the nodes have a packet"
    delays = f"{known_ns[-1] / S:.1f} s (the median source: {known_ns[len(known_ns) // 2] / S:.1f} s)"
    return f"{share} within {delays}, {drawn.links} links"


def describe_change(change: ScenarioChange | None, found: ScenarioPlan) -> str:
    if found.cut_off:
        return item("change", "nodes have to come nearer: nothing that can be set joins the parts of a swarm")
    if change is None:
        return item("change", "none of those searched (clusters, period, backoff, relays, load) makes it feasible")
    lines = [item("change", " ".join(f"--set {argument}" for argument in change.variant.arguments))]
    lines += [item("", f"then {_class(c, change.plan)}") for c in change.plan.classes]
    lines += [item("", note) for note in change.plan.notes if note not in found.notes]
    return "\n".join(lines)


def describe_operator(scenario: Scenario, bounds: list[int], *, known_gone_ns: int = 0) -> str | None:
    """What a ground station in band may count on; None without a post. `known_gone_ns`: how long until the swarm knows
    that a node has left the air.
    """
    if scenario.post is None:
        return None
    pace = pace_of(scenario)
    delay = (
        f"a command, and its acknowledgment, each within {max(bounds) / MS:.0f} ms, "
        "when the post sends as often as a source"
        if bounds
        else "no bound for a command"
    )
    if bounds and known_gone_ns:
        delay += f", but to a UAV that has left the air, which is known after {known_gone_ns / S:.1f} s"
    return (
        f"telemetry of each UAV every {pace.interval_ns / S:.1f} s or less often ({pace.share:.0%} of the air); {delay}"
    )


def item(label: str, text: str) -> str:
    """A labelled paragraph; a line that is meant to be copied is not wrapped."""
    first = f"  {label:{_LABEL}}"
    if "--set" in text:
        return first + text
    return textwrap.fill(text, _WIDTH, initial_indent=first, subsequent_indent=" " * len(first), break_on_hyphens=False)


def _lines(found: ScenarioPlan) -> Iterator[str]:
    yield f"{'FEASIBLE' if found.feasible else 'NOT FEASIBLE'}  {found.scenario.name}: {_shape(found)}"
    yield from (item("problem", problem) for problem in found.problems)
    yield from (item("class" if index == 0 else "", _class(c, found)) for index, c in enumerate(found.classes))
    if isinstance(found.access, Bounded):
        yield item("to the head", "every source is a head" if not found.access.delay_ns else _bound_text(found.access))
    if found.superframe is not None:
        yield from _superframe(found.superframe)
    yield from _capacity(found)
    bottleneck = found.bottleneck
    if bottleneck is not None and bottleneck.usable_ns:
        yield item("bottleneck", f"the slot of head {bottleneck.head}, {100 * bottleneck.utilization:.0f} % used")
    if found.superframe is None or found.superframe.used:
        yield from _details(found)
    yield from (item("note", note) for note in found.notes)


def _details(found: ScenarioPlan) -> Iterator[str]:
    yield item("equation (4)", f"says {_bound_text(found.paper)} per cluster: the paper's estimate, to compare with")
    yield from _slots(found)


def _shape(found: ScenarioPlan) -> str:
    scenario = found.scenario
    relays = (
        "collision-free floods" if found.superframe else f"floods relayed by contention ({scenario.clusters.relay})"
    )
    return (
        f"{scenario.node_count} nodes, {scenario.clusters.count} clusters, flooding period "
        f"{scenario.clusters.flooding_period_s:g} s, {relays}"
    )


def _superframe(superframe: TimetablePlan) -> Iterator[str]:
    turns = superframe.turns
    yield item(
        "superframe",
        f"{turns.contention_ns / MS:g} ms of contention + {turns.per_superframe} turns of {turns.turn_ns / MS:.3f} ms",
    )
    if superframe.used:
        share = 100 * superframe.used / turns.per_superframe
        floods = "packets" if superframe.together == 1 else f"frames of {superframe.together} packets"
        yield item("turns in use", f"{superframe.used} ({share:.0f} %) for {superframe.packets} {floods} a period")


def _capacity(found: ScenarioPlan) -> Iterator[str]:
    """What this configuration can carry, and what no protocol can exceed."""
    carried, most = found.carried_per_second, found.goodput
    application = next((c for c in found.classes if c.name == "application"), None)
    if carried is not None and application is not None:
        about = "" if found.superframe else "about "
        yield item(
            "capacity",
            f"{about}one packet per source every {application.sources / carried:.3f} s ({carried:.0f} a second)",
        )
    if most is not None:
        share = "" if carried is None else f"; this configuration: {100 * carried / most.per_second:.0f} % of that"
        yield item(
            "any protocol",
            f"at most one packet per source every {most.least_interval_ns / S:.3f} s ({most.per_second:.0f} a second) "
            f"can reach everyone{share}",
        )


def _class(c: ClassPlan, found: ScenarioPlan) -> str:
    line = f"{c.name}, {c.sources} sources every {c.interval_ns / S:g} s: {_bound_text(c.bound)}"
    if isinstance(c.bound, Bounded) and isinstance(c.from_head, Bounded) and c.bound != c.from_head:
        line += f" ({c.from_head.delay_ns / S:.3f} s from the head on)"
    if isinstance(c.bound, Bounded) and found.draws:
        line += f" in {100 * found.confidence:.0f} % of flights" + (
            ", but for changes of the timetable" if found.varying else ""
        )
    if isinstance(c.bound, Bounded) and not found.proven:
        line += ", an estimate"
    if found.deadline_ns is not None:
        verdict = "met" if c.meets(found.deadline_ns) else "NOT met"
        line += f"; deadline {found.deadline_ns / S:g} s {verdict}"
    return line


def _slots(found: ScenarioPlan) -> Iterator[str]:
    yield "\n    head  members  hops  slot ms  flood ms  packets/period  used %  waiting"
    fullest = sorted(found.clusters, key=lambda c: (-c.utilization, c.head))
    yield from (_cluster(cluster) for cluster in fullest[:_SHOWN])
    if len(fullest) > _SHOWN:
        yield f"    and {len(fullest) - _SHOWN} heads with no fuller slots"
    yield ""


def _cluster(c: ClusterPlan) -> str:
    queue = "-" if c.backlog is None else str(c.backlog)
    used = f"{100 * c.utilization:.0f}" if c.usable_ns else "-"
    return (
        f"    {c.head:4}  {c.members:7}  {c.hops:4}  {c.slot_ns / MS:7.1f}  {c.flood.duration_ns / MS:8.1f}  "
        f"{c.packets:14.1f}  {used:>6}  {queue:>7}"
    )


def _bound_text(outcome: DelayBound) -> str:
    if isinstance(outcome, Bounded):
        return f"at most {outcome.delay_ns / S:.3f} s"
    return f"no bound ({outcome.reason})"
