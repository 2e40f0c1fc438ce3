"""What collision-free floods can carry, before take-off: the same timetable that the nodes will compute.

    load fits the turns, every node a head  -> bound per node, worst of all
    it does not                             -> the least traffic interval that does, the cheapest change that helps

With fewer heads than nodes the way to a head contends: what is let out is judged, but no bound is stated.
"""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from fanet_mw.protocol.clustering import balanced
from fanet_mw.protocol.planner.design import Design
from fanet_mw.protocol.scheduled import fit, largest_frame, links
from fanet_mw.protocol.timetable import Timetable, timetable
from fanet_mw.protocol.turns import Turns, turn_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S, seconds_to_ns

_PERIODS_S: Final = (0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 5.0)
_WINDOWS: Final = (31, 15, 7, 3, 1)
_MOST_TURNS: Final = 20_000


class TurnsPlan(NamedTuple):
    """The verdict on one setting."""

    period_ns: int
    contention_ns: int
    turn_ns: int
    turns: int
    """Turns of a superframe."""
    used: int
    """Of which some node sends in."""
    packets: int
    """Packets that the roots may let out per superframe; 0: not even one each."""
    least_interval_ns: int | None
    """The traffic interval down to which everything arrives; None: none."""
    bound_ns: int | None
    """The longest any packet takes to everyone; None: no bound."""
    problems: tuple[str, ...]
    change: tuple[str, ...] = ()
    """The cheapest settings that help, as `--set` takes them."""

    @property
    def feasible(self) -> bool:
        return not self.problems


def plan_turns(
    scenario: Scenario, positions: Mapping[NodeId, Enu], *, deadline_ns: int | None = None, search: bool = True
) -> TurnsPlan:
    """Judge a scenario with `clusters.relay = "scheduled"`; when it is not feasible, look for what would make it so."""
    found = _judge(scenario, positions, deadline_ns)
    if found.feasible or not search:
        return found
    for settings, other in _candidates(scenario):
        if _judge(other, positions, deadline_ns).feasible:
            return found._replace(change=settings)
    return found


def _judge(scenario: Scenario, positions: Mapping[NodeId, Enu], deadline_ns: int | None) -> TurnsPlan:
    clusters = scenario.clusters
    turn = turn_ns(scenario, payload_bytes=largest_frame(scenario))
    contention_ns = round(clusters.contention_ms * MS)
    per_frame = max(0, clusters.period_ns - contention_ns) // turn
    turns = Turns(0, clusters.period_ns, contention_ns, turn, per_frame)
    heads = _heads(scenario, positions)
    interval_ns = seconds_to_ns(scenario.traffic.interval_s)
    packets, table = _most(scenario, positions, heads, turns)
    problems = []
    if table is None:
        needed = _needed(scenario, positions, heads)
        problems.append(f"one packet of each of {len(heads)} roots needs {needed} turns, a superframe has {per_frame}")
        return TurnsPlan(clusters.period_ns, contention_ns, turn, per_frame, 0, 0, None, None, tuple(problems))
    members = max(heads.values())
    least_ns = -(-clusters.period_ns * members // packets)
    if interval_ns < least_ns:
        problems.append(
            f"a packet every {interval_ns / S:g} s is more than fits: at most one every {least_ns / S:.3f} s"
        )
    parts = sorted(root for root, missing in table.uncovered.items() if missing)
    if parts:
        problems.append(f"the swarm is in parts: {len(parts)} roots cannot reach everyone, {parts[0]} among them")
    table = fit(scenario, tuple(sorted(positions.items())), heads, turns) or table  # the one that the nodes will make
    bound_ns = None if problems or members > 1 else _bound(turns, table, interval_ns)
    if deadline_ns is not None and (bound_ns is None or bound_ns > deadline_ns):
        said = "no bound" if bound_ns is None else f"{bound_ns / MS:.1f} ms"
        problems.append(f"worst delay is {said}, the deadline {deadline_ns / MS:g} ms")
    return TurnsPlan(
        clusters.period_ns, contention_ns, turn, per_frame, table.used, packets * len(heads), least_ns, bound_ns,
        tuple(problems),
    )  # fmt: skip


def _heads(scenario: Scenario, positions: Mapping[NodeId, Enu]) -> dict[NodeId, int]:
    """The members of each head, the leader's own root with none."""
    others = {node: at for node, at in positions.items() if node != scenario.leader}
    heads = {cluster.head: len(cluster.members) for cluster in balanced(others, count=scenario.clusters.count)}
    return heads | {scenario.leader: 0}


def _most(
    scenario: Scenario, positions: Mapping[NodeId, Enu], heads: Mapping[NodeId, int], turns: Turns
) -> tuple[int, Timetable | None]:
    """As many packets of each root per superframe as fit, and their table."""
    best: tuple[int, Timetable | None] = (0, None)
    places = tuple(sorted(positions.items()))
    geometry = links(scenario, turns)
    for packets in range(1, max(2, turns.per_frame // len(heads) + 1)):
        roots = tuple(root for root, members in sorted(heads.items()) for _ in range(packets if members else 1))
        table = timetable(places, roots, geometry) if turns.per_frame else None
        if table is None:
            return best
        best = packets, table
        if (
            packets * turns.period_ns
            and packets * seconds_to_ns(scenario.traffic.interval_s) > 2 * max(heads.values()) * turns.period_ns
        ):
            return best  # twice the load: more would only cost time
    return best


def _needed(scenario: Scenario, positions: Mapping[NodeId, Enu], heads: Mapping[NodeId, int]) -> int:
    """Turns in use when there is no end of them."""
    turns = Turns(0, S, 0, 1, _MOST_TURNS)
    table = timetable(tuple(sorted(positions.items())), tuple(sorted(heads)), links(scenario, turns))
    return table.used if table else _MOST_TURNS


def _bound(turns: Turns, table: Timetable, interval_ns: int) -> int | None:
    """The worst over all roots."""
    worst = 0
    for root, span in sorted(table.spans.items()):
        offsets = tuple(sorted(turn.offset for turn in table.roots() if turn.root == root))
        bound_ns = turns.worst_ns(offsets, span=span, interval_ns=interval_ns)
        if bound_ns is None:
            return None
        worst = max(worst, bound_ns)
    return worst


def _candidates(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], Scenario]]:
    """Fewest changes first: the period, then the window too, then every node a head as well."""
    clusters, radio = scenario.clusters, scenario.radio
    most = scenario.nodes.count - 1
    counts = [clusters.count] if clusters.count >= most else [clusters.count, most]
    windows = [w for w in _WINDOWS if w < radio.cw_min]
    periods = sorted(
        (p for p in _PERIODS_S if p != clusters.flooding_period_s), key=lambda p: abs(p - clusters.flooding_period_s)
    )
    options: list[dict[str, float | int]] = []
    for count in counts:
        head: dict[str, float | int] = {} if count == clusters.count else {"clusters.count": count}
        options += [head] if head else []
        options += [{**head, "clusters.flooding_period_s": p} for p in periods]
        options += [{**head, "radio.cw_min": w} for w in windows]
        options += [{**head, "clusters.flooding_period_s": p, "radio.cw_min": w} for p in periods for w in windows]
    for option in sorted(options, key=len):
        other = scenario.model_copy(
            update={
                "clusters": clusters.model_copy(update=_under("clusters.", option)),
                "radio": radio.model_copy(update=_under("radio.", option)),
            }
        )
        if Design.of(other).guard_ns < other.clusters.slot_ns:
            yield tuple(f"{key}={value:g}" for key, value in option.items()), other


def _under(prefix: str, option: Mapping[str, float | int]) -> dict[str, float | int]:
    return {key.removeprefix(prefix): value for key, value in option.items() if key.startswith(prefix)}


def describe_turns(found: TurnsPlan) -> str:
    """The verdict in lines."""
    lines = [
        f"{'feasible' if found.feasible else 'not feasible'}: collision-free floods, flooding period "
        f"{found.period_ns / S:g} s = {found.contention_ns / MS:g} ms of contention + {found.turns} turns of "
        f"{found.turn_ns / MS:.3f} ms",
        *(f"  problem: {problem}" for problem in found.problems),
    ]
    if found.packets:
        share = 100 * found.used / found.turns
        lines.append(
            f"  turns in use: {found.used} of {found.turns} ({share:.0f} %) for {found.packets} packets a period"
        )
    if found.least_interval_ns is not None:
        lines.append(f"  everything arrives down to one packet per node every {found.least_interval_ns / S:.3f} s")
    if found.bound_ns is not None:
        lines.append(f"  worst delay to everyone: {found.bound_ns / MS:.1f} ms")
    if found.change:
        lines.append(f"  cheapest change: {' '.join(f'--set {setting}' for setting in found.change)}")
    elif not found.feasible:
        lines.append("  no change of period, contention window or heads makes it feasible: send less, or less often")
    return "\n".join(lines)
