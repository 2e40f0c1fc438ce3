"""Decides when a UAV sends hellos, and remembers which neighbors have recently sent one."""

import math
from typing import Final, Protocol

from fanet_mw.errors import LocalProtocolError
from fanet_mw.node.neighbors import neighbor_lifetime_ns
from fanet_mw.node.node import AnnouncedHello, Node
from fanet_mw.rng import stream
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId, seconds_to_ns

_JITTER: Final = 0.1
"""Hello intervals vary by this share, so that neighbors do not go on to send at the same time (RFC 3626, 3.4)."""


class HelloTime(Protocol):
    """Adds time beacons to the hellos of a node."""

    def frames(self) -> bytes:
        """The inner frames for the hello that is sent now; empty while the node has no time."""

    def announced(self, hello: AnnouncedHello) -> None:
        """The hello was announced to the radio, which will report when it has ended."""


class HelloSchedule:
    """The hellos that one UAV sends and receives."""

    def __init__(self, scenario: Scenario, node: Node, time: HelloTime | None) -> None:
        """`time` adds time beacons to the hellos; None if hellos carry no time."""
        self._node = node
        self._time = time
        self._lead_ns = scenario.radio.lead_ns
        self._interval_ns = seconds_to_ns(scenario.routing.hello_interval_s)
        self._lifetime_ns = neighbor_lifetime_ns(scenario.routing.hello_interval_s)
        self._protocol = scenario.routing.said
        self._random = stream(scenario.seed, "hello", node.node).random
        self._next_ns: int | None = None
        self._heard_ns: dict[NodeId, int] = {}

    def start(self, now_ns: int) -> None:
        """Choose the instant of the first hello: at random within the first interval, or as the protocol says."""
        if self._interval_ns:
            earliest_ns = now_ns + self._lead_ns
            self._next_ns = self._node.first_hello_ns(
                earliest_ns, earliest_ns + int(self._random() * self._interval_ns)
            )

    def due_ns(self) -> int | None:
        """The instant at which the next hello must be announced to the radio."""
        return None if self._next_ns is None else self._next_ns - self._lead_ns

    def say(self, inner: bytes, now_ns: int) -> None:
        """Send the hello that is due, with these frames before those of the protocol and the clock."""
        assert self._next_ns is not None, "a hello is said when it is due"
        start_ns, time = max(self._next_ns, now_ns), self._time
        if time is None:
            self._node.say_hello(inner, start_ns=start_ns, now_ns=now_ns)
        else:
            time.announced(self._node.say_hello(inner, start_ns=start_ns, now_ns=now_ns, time=time.frames()))
        vary = 1 + _JITTER * (2 * self._random() - 1)
        share = self._node.hello_share(now_ns=now_ns)
        if not 0 < share < math.inf:
            raise LocalProtocolError(f"{self._protocol}: hello_share() = {share!r} must be a number above 0")
        step_ns = int(self._interval_ns * vary * share)
        self._next_ns = self._node.hello_due_ns(max(self._next_ns + step_ns, now_ns))

    def on_hello(self, sender: NodeId, now_ns: int) -> None:
        self._heard_ns[sender] = now_ns

    def neighbors(self, now_ns: int) -> tuple[NodeId, ...]:
        """The nodes whose hellos were received recently, by id."""
        self._heard_ns = {node: t_ns for node, t_ns in self._heard_ns.items() if now_ns - t_ns <= self._lifetime_ns}
        return tuple(sorted(self._heard_ns))
