"""Plans a swarm whose links lose frames (`clusters.links`): instead of a bound, each source gets a likely delay.

    expected links by the channel model -> timetable with repeated frames -> (delay, share) for each source

No link has been measured before take-off, so the caller gives the expected quality of each: its mean over fading.
Shadowing is drawn once for a place, so with shadowing the caller gives several draws. The verdict is that of the worst
one.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from fanet_mw.routing.clustered.tdma.turn_timing import receipt_ns
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable, NodeTimetable
from fanet_mw.routing.clustered.timetable.own_bound import likely_delay_ns
from fanet_mw.routing.clustered.timetable.turn_allocation import Places, fit_measured
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.links import Link, frames_of
from sim.planner import flood_hops
from sim.planner.demand import TrafficClass

_NOTES: Final = (
    "links are expected, not measured: nodes at rest where they start, the mean over fading, shadowing drawn anew for "
    "each swarm; in flight hellos measure them",
    "until the first timetable is in force floods contend; nothing is stated of those packets",
    "a delay is stated of the application's packets only; reports and warnings ride along",
)


class Drawn(NamedTuple):
    """The plan for one draw of the channel."""

    links: int
    """The number of pairs of nodes that receive each other at all."""
    fitted: FittedTimetable | None
    """None if none fits: the swarm then flies with one from positions, without stated delays."""
    likely_ns: Mapping[NodeId, int | None]
    """The likely delay of each source; None if its packets miss too many nodes."""

    @property
    def silent(self) -> list[NodeId]:
        return [node for node, delay_ns in self.likely_ns.items() if delay_ns is None]

    @property
    def known_ns(self) -> list[int]:
        return sorted(delay_ns for delay_ns in self.likely_ns.values() if delay_ns is not None)


class LossyPlan(NamedTuple):
    """The verdict over all draws of the channel."""

    scenario: Scenario
    draws: tuple[Drawn, ...]
    deadline_ns: int | None
    problems: tuple[str, ...]
    notes: tuple[str, ...] = _NOTES

    @property
    def feasible(self) -> bool:
        return not self.problems

    @property
    def worst_ns(self) -> int | None:
        """The longest likely delay of any source in any draw; None if some source states none."""
        if any(drawn.silent for drawn in self.draws):
            return None
        return max((drawn.known_ns[-1] for drawn in self.draws if drawn.known_ns), default=None)


def plan_lossy(
    scenario: Scenario,
    positions: Mapping[NodeId, Enu],
    draws: Sequence[tuple[Link, ...]],
    application: TrafficClass,
    *,
    deadline_ns: int | None = None,
) -> LossyPlan:
    """Judge a scenario for several draws of its links. The leader states no delay: its announcements go first."""
    places = tuple(sorted(positions.items()))
    sources = [node for node in application.sources if node != scenario.leader]
    found = tuple(_drawn(scenario, places, links, sources) for links in draws)
    return LossyPlan(scenario, found, deadline_ns, (*_out_of_hops(scenario, found), *_problems(found, deadline_ns)))


def _drawn(scenario: Scenario, places: Places, links: tuple[Link, ...], sources: Sequence[NodeId]) -> Drawn:
    fitted = fit_measured(
        scenario, places, links, leader=scenario.leader, origin_ns=0, link_parts=len(frames_of(links))
    )
    return Drawn(
        len(links), fitted, {node: None if fitted is None else _likely_ns(scenario, fitted, node) for node in sources}
    )


def _likely_ns(scenario: Scenario, fitted: FittedTimetable, node: NodeId) -> int | None:
    """The delay that the node will state, from application to application, for a packet that finds its queue empty."""
    plan = NodeTimetable.of(node, 0, fitted)
    if not plan.roots or fitted.table.uncovered[node] or fitted.table.hops[node] > scenario.routing.hop_limit:
        return None
    likely_ns = likely_delay_ns(
        plan,
        node,
        waiting=1,
        interval_ns=seconds_to_ns(scenario.traffic.interval_s),
        hello_ns=seconds_to_ns(scenario.routing.hello_interval_s),
    )
    return None if likely_ns is None else likely_ns + scenario.radio.lead_ns + receipt_ns(scenario)


def _out_of_hops(scenario: Scenario, draws: Sequence[Drawn]) -> Iterator[str]:
    hops = [most for drawn in draws if drawn.fitted is not None for most in drawn.fitted.table.hops.values()]
    yield from flood_hops.too_many(scenario, max(hops, default=0))


def _problems(draws: Sequence[Drawn], deadline_ns: int | None) -> Iterator[str]:
    many = f"of {len(draws)} draws of the channel"
    unfit = sum(drawn.fitted is None for drawn in draws)
    if unfit:
        yield f"in {unfit} {many} the turns do not hold the load with its repeated frames; one by places would fly"
    silent = [len(drawn.silent) for drawn in draws if drawn.fitted is not None and drawn.silent]
    if silent:
        yield f"in {len(silent)} {many} up to {max(silent)} sources cannot reach 0.99 of the nodes by repeating"
    late = sum(bool(drawn.known_ns) and drawn.known_ns[-1] > deadline_ns for drawn in draws) if deadline_ns else 0
    if late and deadline_ns:
        worst_ns = max(drawn.known_ns[-1] for drawn in draws if drawn.known_ns)
        yield f"in {late} {many} it takes up to {worst_ns / S:.1f} s, the deadline is {deadline_ns / MS:g} ms"
