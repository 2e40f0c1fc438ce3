"""Exact simulation of slots that send whole frames, first come first served; shares no code with the bounds."""

import heapq
from collections.abc import Mapping, Sequence
from typing import NamedTuple


class Slot(NamedTuple):
    airtime_ns: int
    slot_ns: int
    period_ns: int
    start_ns: int = 0


def earliest_start(slot: Slot, t_ns: int) -> int:
    """The first instant from `t_ns` on at which a frame can start and end within an occurrence of the slot."""
    begin = slot.start_ns + (t_ns - slot.start_ns) // slot.period_ns * slot.period_ns
    if t_ns <= begin + slot.slot_ns - slot.airtime_ns:
        return t_ns
    return begin + slot.period_ns


def delays(slot: Slot, arrivals: Sequence[int]) -> list[int]:
    """Delay of each packet, arrival to end of airtime; arrivals in order."""
    free = arrivals[0]
    found = []
    for at in arrivals:
        free = earliest_start(slot, max(at, free)) + slot.airtime_ns
        found.append(free - at)
    return found


class Seen(NamedTuple):
    end_to_end: list[int]
    """Per flow, the worst delay."""
    per_hop: dict[int, int]
    backlog: dict[int, int]


def network(
    slots: Mapping[int, Slot], flows: Sequence[tuple[Sequence[int], Sequence[int]]], relay: Sequence[int] = (0,)
) -> Seen:
    """Flows are (arrival instants, path of hops); relay times are taken in turn."""
    heap: list[tuple[int, int, int, int, int]] = []
    order = 0
    for flow, (arrivals, _) in enumerate(flows):
        for at in arrivals:
            heapq.heappush(heap, (at, order, flow, 0, at))
            order += 1
    free = dict.fromkeys(slots, -(10**30))
    queued: dict[int, list[int]] = {hop: [] for hop in slots}
    seen = Seen([0] * len(flows), dict.fromkeys(slots, 0), dict.fromkeys(slots, 0))
    while heap:
        t, _, flow, index, born = heapq.heappop(heap)
        path = flows[flow][1]
        hop = path[index]
        free[hop] = end = earliest_start(slots[hop], max(t, free[hop])) + slots[hop].airtime_ns
        seen.per_hop[hop] = max(seen.per_hop[hop], end - t)
        queued[hop] = [e for e in queued[hop] if e > t] + [end]
        seen.backlog[hop] = max(seen.backlog[hop], len(queued[hop]))
        if index + 1 == len(path):
            seen.end_to_end[flow] = max(seen.end_to_end[flow], end - born)
        else:
            order += 1
            heapq.heappush(heap, (end + relay[order % len(relay)], order, flow, index + 1, born))
    return seen
