"""Bounds over several heads: what one slot releases arrives as a burst at the next head.

Behind a hop a flow keeps its interval and gains jitter: the hop's worst delay minus its least (one airtime). Frames
from one head arrive no denser than its slot releases them. The worst delay of a path is the sum over its hops, each
with the jitter accumulated so far (Le Boudec & Thiran, 1.4.3 and 1.5; Richter's event streams).

Heads that flood to each other form cycles: A's output is B's input and the reverse. The delays are iterated from below
to a fixed point. This is sound by causality: consider the first packet, in time, to exceed its hop's delay; up to that
instant every arrival had kept to its curve, so the delay could not be exceeded. If the iteration does not converge,
there is no bound.

Assumed: FIFO at each head; all frames of a slot have its airtime; no loss and no retransmission.
"""

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Final, NamedTuple

from fanet_mw.bounds.arrivals import Arrivals, Bounded, DelayBound, Periodic, Refused, Total
from fanet_mw.bounds.network_calculus import backlog, delay_fifo
from fanet_mw.bounds.slot_service import SlotServer
from fanet_mw.errors import LocalProtocolError

_ROUNDS: Final = 500
_HOPELESS_NS: Final = 86_400 * 10**9
"""A jitter of a day counts as divergence."""


def least_span_ns(server: SlotServer, n: int) -> int:
    """The least time from the end of one frame to the end of the (n-1)-th after it: how bursty the output is.

    Up to k frames follow each other directly. More frames need several slots: the last frames of one slot, the
    first of another, and whole slots in between.
    """
    slots = -(-n // server.frames)
    if slots == 1:
        return (n - 1) * server.airtime_ns
    outer = n - (slots - 2) * server.frames
    return (slots - 1) * server.period_ns - server.slot_ns + (outer - 1) * server.airtime_ns


class Limited(NamedTuple):
    """The output of the slot `through`, fed by `source`, each packet then delayed by up to `jitter_ns` more.

    A slot lets at most k frames out per period whatever burst went in, so the lesser of both curves holds.
    """

    source: Arrivals
    through: SlotServer
    jitter_ns: int = 0

    @property
    def rate(self) -> Fraction:
        return min(self.source.rate, Fraction(self.through.frames, self.through.period_ns))

    @property
    def burst(self) -> Fraction:
        slot_rate = Fraction(self.through.frames, self.through.period_ns)
        if self.source.rate <= slot_rate:
            return self.source.burst
        return self.slot_burst

    @property
    def slot_burst(self) -> Fraction:
        """The largest n - rate * span(n) of the slot alone; it repeats every k, except that span(1) is 0."""
        server = self.through
        rate = Fraction(server.frames, server.period_ns)
        return max(
            n - rate * (least_span_ns(server, n) - self.jitter_ns if n > 1 else -self.jitter_ns)
            for n in range(1, 3 * server.frames + 1)
        )

    def spans(self) -> Iterator[int]:
        for n, span_ns in enumerate(self.source.spans(), start=1):
            yield max(span_ns, least_span_ns(self.through, n) - self.jitter_ns)

    def repeat(self) -> tuple[int, int] | None:
        return None


class Hop(NamedTuple):
    """A head: its slot, and the time from the end of a frame's airtime to its queueing at the next head."""

    server: SlotServer
    relay_least_ns: int = 0
    relay_most_ns: int = 0


class Flow(NamedTuple):
    """The packets of one source and the heads that they pass, first to last."""

    arrivals: Periodic
    path: tuple[int, ...]


class PathBounds(NamedTuple):
    """The fixed point: delay end to end per flow (relay times included), delay and backlog per hop."""

    flows: tuple[DelayBound, ...]
    hops: Mapping[int, DelayBound]
    backlogs: Mapping[int, int]


def path_bounds(flows: Sequence[Flow], hops: Mapping[int, Hop]) -> PathBounds:
    """Bound every flow over its path; a flow through an overloaded hop is refused with that hop's reason."""
    for flow in flows:
        flow.arrivals.check()
        if not flow.path or len(set(flow.path)) < len(flow.path) or any(hop not in hops for hop in flow.path):
            raise LocalProtocolError(f"path {flow.path} must name hops of {sorted(hops)}, each once")
    solved = _fixed_point(flows, hops)
    backlogs = {}
    for name, arrivals in _inputs(flows, hops, solved).items():
        frames = backlog(arrivals, hops[name].server)
        if not isinstance(frames, Refused) and isinstance(solved[name], Bounded):
            backlogs[name] = frames
    return PathBounds(tuple(_along(flow, hops, solved) for flow in flows), solved, backlogs)


def _fixed_point(flows: Sequence[Flow], hops: Mapping[int, Hop]) -> dict[int, DelayBound]:
    delays: dict[int, DelayBound] = {name: Bounded(hops[name].server.airtime_ns) for name in sorted(hops)}
    for _ in range(_ROUNDS):
        inputs = _inputs(flows, hops, delays)
        found = {name: delay_fifo(inputs[name], hops[name].server) for name in delays}
        if found == delays:
            return found
        delays = found
        diverging = [name for name, d in delays.items() if isinstance(d, Bounded) and d.delay_ns > _HOPELESS_NS]
        if diverging:
            break
    reason = Refused(f"bursts grow around a cycle of heads: no fixed point after {_ROUNDS} rounds or one day of delay")
    return {name: d if isinstance(d, Refused) else reason for name, d in delays.items()}


def _inputs(flows: Sequence[Flow], hops: Mapping[int, Hop], delays: Mapping[int, DelayBound]) -> dict[int, Arrivals]:
    """What arrives at each hop, given all delays: its own packets, and what each upstream slot releases."""
    own: dict[int, list[Arrivals]] = {name: [] for name in hops}
    relayed: dict[int, dict[int, list[Arrivals]]] = {name: {} for name in hops}
    for flow in flows:
        at = flow.arrivals
        own[flow.path[0]].append(at)
        for here, following in pairwise(flow.path):
            delay = delays[here]
            if isinstance(delay, Refused):
                break
            hop = hops[here]
            least_ns, most_ns = hop.server.airtime_ns + hop.relay_least_ns, delay.delay_ns + hop.relay_most_ns
            at = Periodic(at.interval_ns, at.jitter_ns + most_ns - least_ns)
            relayed[following].setdefault(here, []).append(at)
    inputs: dict[int, Arrivals] = {}
    for name in hops:
        shaped = [
            Limited(Total(tuple(parts)), hops[here].server, hops[here].relay_most_ns - hops[here].relay_least_ns)
            for here, parts in sorted(relayed[name].items())
        ]
        inputs[name] = Total((*own[name], *shaped))
    return inputs


def _along(flow: Flow, hops: Mapping[int, Hop], delays: Mapping[int, DelayBound]) -> DelayBound:
    total_ns = 0
    for name in flow.path:
        delay = delays[name]
        if isinstance(delay, Refused):
            return Refused(f"hop {name}: {delay.reason}")
        total_ns += delay.delay_ns
    return Bounded(total_ns + sum(hops[name].relay_most_ns for name in flow.path[:-1]))


def ordered_tandem(
    arrivals: Arrivals, servers: Sequence[SlotServer], starts_ns: Sequence[int], *, relay_ns: int = 0
) -> DelayBound:
    """The end-to-end delay when the positions of the slots in a common period are known and no other traffic uses them.

    What one occurrence of a slot releases is queued at the next head before that head's next occurrence begins, and
    leaves in it: after the first hop a frame only moves from slot to slot. The gap of two heads is the distance of
    their slots' beginnings, the first distance that leaves room for the slot and for `relay_ns`. Then
    delay = delay(first) + sum of gaps. Slots in the order of the path cross several hops in one period; the reverse
    order costs a period per hop (Djukic & Valaee, Delay aware link scheduling for multi-hop TDMA wireless networks,
    IEEE/ACM ToN 2009).
    """
    if not servers or len(servers) != len(starts_ns):
        raise LocalProtocolError(f"{len(servers)} servers need as many starts_ns, and at least one")
    for at, following in pairwise(servers):
        if following.period_ns != at.period_ns:
            raise LocalProtocolError(f"period_ns {at.period_ns} and {following.period_ns} must be the same")
        if following.frames < at.frames or following.airtime_ns > at.airtime_ns:
            return Refused(
                f"a slot of {following.frames} frames of {following.airtime_ns} ns behind one of {at.frames} frames of "
                f"{at.airtime_ns} ns cannot pass on in one occurrence what it gets in one"
            )
    first = delay_fifo(arrivals, servers[0])
    if isinstance(first, Refused):
        return first
    total_ns = first.delay_ns
    for index, at in enumerate(servers[:-1]):
        least_ns = at.slot_ns + relay_ns
        total_ns += least_ns + (starts_ns[index + 1] - starts_ns[index] - least_ns) % at.period_ns
    return Bounded(total_ns)
