"""One node with its own station that sends what it likes: an actor in the place of a UAV, and the frames of attacks."""

from collections.abc import Mapping, Sequence
from typing import Any

from fanet_mw import wire
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, TxRequest
from fanet_mw.bus.topics import Topics
from fanet_mw.units import BROADCAST, MS, US, NodeId
from fanet_mw.wire import FLAG_FLOOD, Header, Kind

Plan = Sequence[tuple[int, bytes]]
"""When each frame is to be on the air [ns], and the frame."""


class Attacker(Actor):
    """Sends a plan by the station of a node; hears nothing."""

    def __init__(self, node: NodeId, swarm: str, plan: Plan, *, ahead_ns: int = 20 * MS) -> None:
        super().__init__(f"agent-{node}", ())
        self._ahead_ns = ahead_ns
        self._node = node
        self._topic = Topics(swarm).radio_tx(node)
        self._plan = sorted(plan)
        self._sent = 0

    def start(self, now_ns: int) -> None:
        pass

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        raise AssertionError("it hears nothing")

    def next_wake_ns(self) -> int | None:
        return self._plan[self._sent][0] - self._ahead_ns if self._sent < len(self._plan) else None

    def wake(self, now_ns: int) -> None:
        while self._sent < len(self._plan) and self._plan[self._sent][0] - self._ahead_ns <= now_ns:
            t_ns, frame = self._plan[self._sent]
            self.outbox.append(
                (self._topic, TxRequest(self._sent, max(t_ns, now_ns), frame, BROADCAST, wants_status=False))
            )
            self._sent += 1

    def report(self) -> Mapping[str, Any]:
        own = {"kind": "agent", "node": self._node, "generated": 0, "bus_malformed": 0}
        return {**own, "frames_sent": self._sent, "receptions": 0, "dropped": {}}


def packet(
    inner: bytes, *, by: int, t_ns: int, origin: int | None = None, seq: int = 0, kind: Kind = Kind.DATA,
    flags: int = FLAG_FLOOD, hop_limit: int = 32, hops: int | None = None, priority: int = wire.PRIORITY_REPORT,
    destination: int = BROADCAST,
) -> bytes:  # fmt: skip
    """A frame as if node `by` had made it, or passed it on for `origin`; `t_ns`: when it claims to be born."""
    origin = by if origin is None else origin
    hops = (0 if origin == by else 1) if hops is None else hops
    return Header(t_ns // US, seq, origin, destination, by, kind, hop_limit, hops, priority, flags).encode() + inner
