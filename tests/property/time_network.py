"""Nodes with clocks of their own that exchange hellos over a graph, for tests of `timesync`: no radio, no protocol.

Each node says hello about once a second; a hello ends up to `DEFER_NS` after it was made, as contention has it, reaches
each neighbor after a flight, and may be lost there. Stamps are cut to `STAMP_NS`.
"""

import heapq
import math
from collections.abc import Mapping, Sequence
from random import Random

from agents.clock.local_clock import LocalClock
from fanet_mw.scenario import Clock
from fanet_mw.timesync.clock_fit import Oscillator
from fanet_mw.timesync.ftsp import Settings, TimeSync
from fanet_mw.units import MS, US, NodeId, S
from fanet_mw.wire.hello.beacon import TimeBeacon

DEFER_NS = 40 * MS
FLIGHT_NS = 834
STAMP_NS = US


class Member:
    """One node."""

    def __init__(self, node: int, clock: Clock, seed: int) -> None:
        self.node = NodeId(node)
        self.clock = LocalClock(clock, seed=seed, node=self.node)
        oscillator = Oscillator(2e-6 * clock.drift_ppm, 1e-6 * clock.wander_ppm, STAMP_NS)
        self.sync = TimeSync(Settings(self.node, node == 1, S, oscillator, FLIGHT_NS, clock.limit_ns, NodeId(1)))
        self.hello = 0
        self.alive = True

    def stamp(self, true_ns: int) -> int:
        return self.clock.local_ns(true_ns) // STAMP_NS * STAMP_NS

    def swarm_ns(self, true_ns: int) -> int:
        return self.sync.line.swarm_ns(self.clock.local_ns(true_ns))

    def error_ns(self, true_ns: int) -> int | None:
        return self.sync.error_ns(self.clock.local_ns(true_ns))


class Network:
    """The graph, and what is under way."""

    def __init__(self, links: Mapping[int, Sequence[int]], clock: Clock, *, seed: int, loss: float = 0.0) -> None:
        self.members = {node: Member(node, clock, seed) for node in sorted(links)}
        self.links = links
        self.now_ns = 0
        self._loss = loss
        self._random = Random(f"network/{seed}")
        self._due = [(self._random.randrange(S), node) for node in sorted(links)]
        heapq.heapify(self._due)
        for member in self.members.values():
            member.sync.start(member.clock.local_ns(0))

    def run(self, until_s: float) -> None:
        """Everything up to that instant."""
        while self._due[0][0] <= until_s * S:
            now_ns, node = heapq.heappop(self._due)
            self.now_ns = now_ns
            heapq.heappush(self._due, (now_ns + int(S * self._random.uniform(0.9, 1.1)), node))
            if self.members[node].alive:
                self._say(self.members[node], now_ns)
        self.now_ns = int(until_s * S)

    def _say(self, member: Member, now_ns: int) -> None:
        member.clock.pass_time(now_ns, until_ns=10**13)
        beacon = member.sync.beacon(member.clock.local_ns(now_ns))
        ended_ns = now_ns + self._random.randrange(DEFER_NS)
        member.hello += 1
        member.sync.hello_sent(member.hello, ended_ns=member.stamp(ended_ns))
        for node in self.links[member.node]:
            self.deliver(node, member.node, member.hello, beacon, ended_ns + self._random.randrange(FLIGHT_NS))

    def deliver(self, node: int, src: int, hello: int, beacon: TimeBeacon | None, ended_ns: int) -> None:
        """A hello reaches a neighbor, or not."""
        other = self.members[node]
        if not other.alive or self._random.random() < self._loss:
            return
        other.clock.pass_time(ended_ns, until_ns=10**13)
        local_ns = other.clock.local_ns(ended_ns)
        other.sync.on_hello(NodeId(src), hello, beacon, ended_ns=other.stamp(ended_ns), local_ns=local_ns)

    def errors(self, reference: int = 1) -> dict[int, tuple[int, int | None]]:
        """(true error against the reference's time, bound that the node states), by node."""
        truth_ns = self.members[reference].swarm_ns(self.now_ns)
        return {
            node: (abs(member.swarm_ns(self.now_ns) - truth_ns), member.error_ns(self.now_ns))
            for node, member in self.members.items()
            if member.alive
        }

    def worst_us(self, reference: int = 1) -> float:
        return max(error for error, _ in self.errors(reference).values()) / US


def line(count: int) -> dict[int, list[int]]:
    """1 - 2 - ... - count."""
    return {node: [n for n in (node - 1, node + 1) if 1 <= n <= count] for node in range(1, count + 1)}


def connected(count: int, extra: int, seed: int) -> dict[int, list[int]]:
    """A random tree with some more links."""
    random = Random(f"graph/{seed}")
    links: dict[int, set[int]] = {node: set() for node in range(1, count + 1)}
    pairs = [(node, random.randrange(1, node)) for node in range(2, count + 1)]
    pairs += [(random.randrange(1, count + 1), random.randrange(1, count + 1)) for _ in range(extra)]
    for a, b in pairs:
        if a != b:
            links[a].add(b)
            links[b].add(a)
    return {node: sorted(others) for node, others in links.items()}


def depth(links: Mapping[int, Sequence[int]]) -> int:
    """Hops from node 1 to the farthest."""
    hops, edge = {1: 0}, [1]
    while edge:
        edge = [other for node in edge for other in links[node] if hops.setdefault(other, math.inf) == math.inf
                and not hops.update({other: hops[node] + 1})]  # fmt: skip
    return int(max(hops.values()))
