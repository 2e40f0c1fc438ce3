"""Decides how the turns of a superframe are used: how many turns each root gets, and how many packets share a frame.

The uses are tried in the order of docs/explanation/timetable.md (How many turns each node gets) until a timetable is
found. Unless only heads get turns, a member's packet has turns on a shortest way to its head, which relays it in the
next turn. Which turn each packet gets: `list_scheduling.py`.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from typing import Final, NamedTuple, TypeVar

from fanet_mw.routing.clustered.links.heard_load import packets, stated_loads
from fanet_mw.routing.clustered.tdma.turn_timing import Turns, turn_ns
from fanet_mw.routing.clustered.timetable.interference import Geometry
from fanet_mw.routing.clustered.timetable.list_scheduling import Effort
from fanet_mw.routing.clustered.timetable.node_timetable import NO_LOADS, FittedTimetable
from fanet_mw.routing.clustered.timetable.timetable import Timetable, redundant_timetable, timetable
from fanet_mw.routing.clustered.timetable.turn_size import (
    LOAD,
    hello_bytes,
    largest_frame,
    links,
    measured_period_ns,
    most_together,
    schedule_parts,
    superframe,
)
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S, seconds_to_ns
from fanet_mw.wire.links import Link
from fanet_mw.wire.loads import AS_EXPECTED

_FEWER: Final = 0.95
"""If the turns do not suffice, this share of the load is tried next, then this share of that, and so on."""
_EASY: Final = (Effort(), Effort(pace=0.9))
_HARD: Final = Effort(pace=0.8, tries=8)
"""The search effort for a load that does not fit with the ordinary one."""

_REDUNDANCY: Final = ((9, 0.01), (7, 0.03), (5, 0.05), (4, 0.05), (3, 0.05), (3, 0.1), (3, 0.3))
"""The redundancies to try with measured links, the best first: the margin against interference [dB], and the
probability that a node loses all copies of a packet. Unforeseen interference costs more than one repetition less."""
_PACES: Final = (1.0, 0.9)
_DRAINING: Final = 1.5
"""If there are turns enough, a node that sends more than the scenario states gets turns for this multiple of its load,
so that the packets that wait already are sent, too."""
_CALLS_PER_S: Final = 3
"""How often per second a node may transmit a frame that only its neighbors need, with measured links."""

_MOST_PARTS: Final = 8
"""The most parts of a superframe in each of which a node has turns for its load."""

_BLOCK: Final = 300
"""The least number of packets in a block: with fewer, turns are filled less densely; more take long to compute."""

T = TypeVar("T")

Places = tuple[tuple[NodeId, Enu], ...]
"""The positions of the nodes [m], in ascending order of ids."""


class _Wish(NamedTuple):
    """One way to try: the number of packets of each root, and how many of them share a turn."""

    roots: tuple[NodeId, ...]
    together: int
    hard: bool
    blocks: int = 1
    whole: bool = True
    enough: bool = True


def fit(
    scenario: Scenario,
    places: Places,
    head_of: Mapping[NodeId, NodeId],
    *,
    leader: NodeId | None = None,
    origin_ns: int = 0,
    period_ns: int | None = None,
    loads: Mapping[NodeId, int] = NO_LOADS,
    quick: bool = False,
) -> FittedTimetable | None:
    """The timetable of a swarm; None if not even one packet of each head fits, or with `quick` if it would take
    seconds. `head_of`: but for the leader; `loads`: of nodes that do not send as the scenario says. Nodes without
    traffic get one turn each.
    """
    sent = {**stated_loads(scenario), **loads}
    return _fit(
        scenario,
        places,
        tuple(sorted(head_of.items())),
        leader=leader or scenario.leader,
        origin_ns=origin_ns,
        whole_ns=scenario.clusters.period_ns if period_ns is None else period_ns,
        sent=tuple(sorted(sent.items())),
        quick=quick,
    )


@lru_cache(maxsize=16)
def _fit(
    scenario: Scenario,
    places: Places,
    members: tuple[tuple[NodeId, NodeId], ...],
    *,
    leader: NodeId,
    origin_ns: int,
    whole_ns: int,
    sent: tuple[tuple[NodeId, int], ...],
    quick: bool,
) -> FittedTimetable | None:
    """As `fit`. All nodes of a run in virtual time ask for the same one, which may take a second."""
    head_of, loads = dict(members), dict(sent)
    heads = tuple((node, head) for node, head in members if node != head)
    wishes = _wishes_by_load(scenario, head_of, leader, whole_ns, loads) if loads else None
    ordered = wishes or _wishes(scenario, head_of, leader, whole_ns)

    def made(wish: _Wish) -> FittedTimetable | None:
        turns = superframe(scenario, origin_ns=origin_ns, period_ns=whole_ns, together=wish.together)
        geometry, ways = links(scenario, turns), heads if wish.whole else ()
        table = _table(places, wish.roots, geometry, ways, blocks=wish.blocks, hard=wish.hard and not quick)
        if table is None:
            return None
        frame_bytes = largest_frame(scenario, together=wish.together)
        return FittedTimetable(turns, table, wish.together, frame_bytes, wish.whole, wish.enough, loads=loads)

    scarce = list[_Wish]()
    for wish in islice(ordered, int(quick), None):
        if wish.enough:
            found = made(wish)
            if found is not None:
                return _more_often(wish, made) or found
        elif quick:
            return None
        else:
            scarce.append(wish)
    return _first_made(scarce, made)


def _more_often(wish: _Wish, made: Callable[[_Wish], FittedTimetable | None]) -> FittedTimetable | None:
    """As many turns in several parts, if twice as many fit: half of the air is left for single neighbors."""
    parts = 1
    while wish.blocks == 1 and parts < _MOST_PARTS and made(wish._replace(blocks=4 * parts)) is not None:
        parts *= 2
    return made(wish._replace(blocks=parts)) if parts > 1 else None


def _first_made(wishes: Sequence[_Wish], made: Callable[[_Wish], FittedTimetable | None]) -> FittedTimetable | None:
    """The first wish that fits, by bisection of wishes for fewer and fewer turns: there may be dozens."""
    best, low, high = None, 0, len(wishes)
    while low < high:
        middle = (low + high) // 2
        found = made(wishes[middle])
        if found is None:
            low = middle + 1
        else:
            best, high = found, middle
    return best


def fit_measured(
    scenario: Scenario,
    places: Places,
    measured: tuple[Link, ...],
    *,
    leader: NodeId,
    origin_ns: int,
    link_parts: int,
    loads: Mapping[NodeId, int] = NO_LOADS,
) -> FittedTimetable | None:
    """A timetable by measured links: nodes send their own packets, repeated as turns allow; None if too few."""
    whole_ns = measured_period_ns(scenario)
    size = max(largest_frame(scenario), hello_bytes(scenario))
    turn = turn_ns(scenario, payload_bytes=size)
    contention_ns = round(scenario.clusters.contention_ms * MS * whole_ns / scenario.clusters.period_ns)
    turns = Turns(origin_ns, whole_ns, contention_ns, turn, max(0, whole_ns - contention_ns) // turn)
    own = _sending_leader(scenario, leader)
    loads = {**stated_loads(scenario), **loads}
    senders = [node for node, _ in places if node != leader or own]
    per_node = _per_node(scenario, senders, whole_ns, loads)
    each = {node: max(1, math.ceil(per_node[node] / LOAD - 1e-3)) for node in senders}
    control = (leader,) * (schedule_parts(scenario) + link_parts)
    roots = (*control, *(node for node in senders for _ in range(each[node])))
    if len(roots) > turns.per_superframe:
        return None
    calls = max(1, round(_CALLS_PER_S * whole_ns / S))
    geometry = links(scenario, turns)
    for margin_db, epsilon in _REDUNDANCY:
        for pace in _PACES:
            found = redundant_timetable(
                places, measured, roots, geometry, calls=calls, epsilon=epsilon, margin_db=margin_db, pace=pace
            )
            if found is not None:
                return FittedTimetable(turns, found[0], 1, size, whole=True, enough=True, odds=found[1], loads=loads)
    return None


def least_interval_ns(scenario: Scenario, places: Places, head_of: Mapping[NodeId, NodeId]) -> int | None:
    """The least interval of traffic at which the load fits the turns; it is searched for up to twice the load."""
    period_ns = scenario.clusters.period_ns
    heads = tuple((node, head) for node, head in sorted(head_of.items()) if node != head)
    silent = stated_loads(scenario)
    everyone = _senders(scenario, head_of, scenario.leader)
    senders = [node for node in everyone if node not in silent]
    control = (*_control(scenario, scenario.leader), *(node for node in everyone if node in silent))
    enough = 2 * period_ns / seconds_to_ns(scenario.traffic.interval_s)
    best = 0
    for together in range(1, most_together(scenario) + 1):
        turns = superframe(scenario, together=together)
        geometry = links(scenario, turns)

        def fits(packets: int, geometry: Geometry, *, hard: bool) -> bool:
            blocks = 1 if silent else _blocks(packets * len(senders), len(senders))
            roots = (*control, *(node for node in senders for _ in range(packets // blocks)))
            return _table(places, roots, geometry, heads, blocks=blocks, hard=hard) is not None

        most = min(turns.per_superframe // max(1, len(senders)), math.ceil(enough / together))
        low, high = best // together, most
        while low < high:
            middle = (low + high + 1) // 2
            low, high = (middle, high) if fits(middle, geometry, hard=False) else (low, middle - 1)
        while low < most and fits(low + 1, geometry, hard=True):
            low += 1
        best = max(best, low * together)
    return -(-period_ns // best) if best else None


def _table(
    places: Places,
    roots: tuple[NodeId, ...],
    geometry: Geometry,
    heads: tuple[tuple[NodeId, NodeId], ...],
    *,
    blocks: int,
    hard: bool,
) -> Timetable | None:
    """Of the timetables found with little effort that whose floods end soonest; if there is none, with `hard`, that of
    more effort.
    """
    if not geometry.turns:
        return None
    found = [(effort, timetable(places, roots, geometry, heads, effort, blocks)) for effort in _EASY]
    easy = [(_lasts(table) - effort.pace * geometry.turns, table) for effort, table in found if table is not None]
    if easy:
        return min(easy, key=lambda item: item[0])[1]
    return timetable(places, roots, geometry, heads, _HARD, blocks) if hard else None


def _lasts(table: Timetable) -> int:
    return max(table.spans.values(), default=0)


def _wishes(scenario: Scenario, head_of: Mapping[NodeId, NodeId], leader: NodeId, period_ns: int) -> Iterator[_Wish]:
    """The uses of the turns to try, the best first."""
    control, senders = _control(scenario, leader), _senders(scenario, head_of, leader)
    per_node = period_ns / seconds_to_ns(scenario.traffic.interval_s)
    most = most_together(scenario)

    def wish(packets: int, together: int, *, hard: bool, enough: bool = True) -> _Wish:
        blocks = _blocks(packets, len(senders))
        each, more = divmod(packets // blocks, max(1, len(senders)))
        turns = (node for rank, node in enumerate(senders) for _ in range(each + (rank < more)))
        return _Wish((*control, *turns), together, hard, blocks, enough=enough)

    yield wish((int(per_node) + 1) * len(senders), 1, hard=False)
    fewest = _turns_for(per_node, together=most)
    for together, needed in _sharing(lambda together: _turns_for(per_node, together=together), most):
        yield wish(needed * len(senders), together, hard=needed == fewest)
    together = next(n for n in range(1, most + 1) if per_node / n <= fewest + 1e-9)
    packets = fewest * len(senders)
    while packets > len(senders):
        packets = max(len(senders), int(packets * _FEWER))
        yield wish(packets, together, hard=packets == len(senders), enough=False)
    if together > 1:
        yield wish(len(senders), 1, hard=True, enough=False)
    yield _for_heads(scenario, head_of, leader)


def _wishes_by_load(
    scenario: Scenario, head_of: Mapping[NodeId, NodeId], leader: NodeId, period_ns: int, loads: Mapping[NodeId, int]
) -> Iterator[_Wish]:
    """Uses to try if loads differ between nodes, the best first. While all fit, nodes keep turns that they do not need
    now; if not, those that send most get fewer turns first, so that one that sends too much, or is falsely reported to,
    takes nothing from others.
    """
    control, senders = _control(scenario, leader), _senders(scenario, head_of, leader)
    per_node = _per_node(scenario, senders, period_ns, loads)
    most = most_together(scenario)

    def needed(together: int) -> dict[NodeId, int]:
        return {node: _turns_for(per_node[node], together=together) for node in senders}

    def wishes(each: Mapping[NodeId, int], together: int, *, hard: bool, enough: bool = True) -> Iterator[_Wish]:
        turns = superframe(scenario, period_ns=period_ns, together=together)
        if len(control) + sum(each.values()) <= turns.per_superframe:
            roots = (*control, *(node for node in senders for _ in range(each[node])))
            yield _Wish(roots, together, hard, enough=enough)

    expected = _per_node(scenario, senders, period_ns, stated_loads(scenario))
    ample = {n: _DRAINING * sent if sent > expected[n] else expected[n] for n, sent in per_node.items()}
    yield from wishes({node: int(each) + 1 for node, each in ample.items()}, 1, hard=False)
    yield from wishes({node: int(per_node[node]) + 1 for node in senders}, 1, hard=False)
    fewest = needed(most)
    for together, each in _sharing(needed, most):
        yield from wishes(each, together, hard=each == fewest)
    together = next(n for n in range(1, most + 1) if needed(n) == fewest)
    for level in range(max(fewest.values(), default=1) - 1, 0, -1):
        cut = {node: min(level, each) for node, each in fewest.items()}
        yield from wishes(cut, together, hard=level == 1, enough=False)
    if together > 1:
        yield from wishes(dict.fromkeys(senders, 1), 1, hard=True, enough=False)
    yield _for_heads(scenario, head_of, leader)


def _per_node(
    scenario: Scenario, senders: Iterable[NodeId], within_ns: int, loads: Mapping[NodeId, int]
) -> dict[NodeId, float]:
    """The number of packets that each sender makes within a duration."""
    interval_s = scenario.traffic.interval_s
    return {node: packets(loads.get(node, AS_EXPECTED), within_ns=within_ns, interval_s=interval_s) for node in senders}


def _blocks(packets: int, senders: int) -> int:
    """The number of equal blocks of a superframe, of at least `_BLOCK` packets each, preferably without remainder."""
    each, more = divmod(packets, max(1, senders))
    if more or not senders:
        return max(1, packets // _BLOCK)
    return max(n for n in range(1, each + 1) if n == 1 or (each % n == 0 and packets // n >= _BLOCK))


def _for_heads(scenario: Scenario, head_of: Mapping[NodeId, NodeId], leader: NodeId) -> _Wish:
    """One turn for each head, and for the leader if it sends packets of its own."""
    roots = (*sorted(set(head_of.values())), *_sending_leader(scenario, leader))
    return _Wish((*_control(scenario, leader), *roots), 1, hard=True, whole=False, enough=False)


def _turns_for(packets: float, *, together: int) -> int:
    """The number of turns that a node needs for its packets if `together` of them share a turn; at least one."""
    return max(1, math.ceil(packets / together - 1e-9))


def _sharing(needed: Callable[[int], T], most: int) -> Iterator[tuple[int, T]]:
    """How many packets may share a turn, up to `most`, and the turns then needed; no number that saves none."""
    before: T | None = None
    for together in range(1, most + 1):
        turns = needed(together)
        if turns != before:
            yield together, turns
        before = turns


def _control(scenario: Scenario, leader: NodeId) -> tuple[NodeId, ...]:
    return (leader,) * schedule_parts(scenario)


def _senders(scenario: Scenario, head_of: Mapping[NodeId, NodeId], leader: NodeId) -> list[NodeId]:
    return [*sorted(head_of), *_sending_leader(scenario, leader)]


def _sending_leader(scenario: Scenario, leader: NodeId) -> tuple[NodeId, ...]:
    """The leader if it sends packets of its own: also one that took over goes on with the load that it had."""
    return (leader,) if leader != scenario.leader or leader_load(scenario) else ()


def leader_load(scenario: Scenario) -> int:
    """1 if the leader's application may send, although it is in no cluster; otherwise 0."""
    traffic = scenario.traffic
    if traffic.arrivals == "none" or traffic.destination == scenario.leader:
        return 0
    if isinstance(traffic.sources, tuple):
        return int(scenario.leader in traffic.sources)
    others = scenario.nodes.count - 1 - (traffic.destination != "all")
    return int(traffic.sources == "all" or traffic.sources > others)
