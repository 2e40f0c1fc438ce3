"""What passes between ground stations and UAVs, and what does not. Sans-IO: bytes go in, bytes for someone come out.

    UAV -> ground stations   every frame of its flight controller, on every link that shows it
    ground station -> UAV    whole, known, unforged frames for a UAV of that link, as many as a link may send

A link that shows all UAVs is one stream with a sequence for each of them, as it left the UAV: what a ground station
counts as lost was lost on its link.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from typing import Final, NamedTuple

from fanet_mw.errors import MalformedFrameError
from fanet_mw.flavors import Flavor
from fanet_mw.gateway.framing import Frame, Framing
from fanet_mw.gateway.signing import Signing, unsigned
from fanet_mw.gateway.translation import Ardupilot
from fanet_mw.mavlink import AUTOPILOT_COMPONENT
from fanet_mw.units import NodeId
from fanet_mw.wire import frames, renumbered, system_id

MOST_PER_S: Final = 2000
"""Frames that one link may send to UAVs in a second, each copy counted: 45 UAVs and their parameters need 500."""
_BURST: Final = 4000
_MOST_PEERS: Final = 32


class ToUav(NamedTuple):
    """Frames for one UAV."""

    node: NodeId
    data: bytes


class _Numbers:
    """The sequence of one UAV on one link: that of the UAV, and what the gateway has said in its name."""

    def __init__(self) -> None:
        self._last = -1
        self._inserted = 0

    def of(self, frame: bytes) -> bytes:
        self._last = frame[4]
        return renumbered(frame, (frame[4] + self._inserted) % 256) if self._inserted else frame

    def inserted(self, frame: bytes) -> bytes:
        self._inserted += 1
        return renumbered(frame, (self._last + self._inserted) % 256)


class Link:
    """One connection, with the UAVs that are seen on it."""

    def __init__(
        self,
        name: str,
        nodes: Collection[NodeId],
        *,
        flavor: Flavor,
        signing: Signing | None,
        swarm: Collection[NodeId] = (),
    ) -> None:
        """`swarm`: all UAVs, in whose names nobody may speak here; by default those that are seen."""
        self.name = name
        self._uavs = {system_id(node) for node in swarm or nodes}
        self.counts: Counter[str] = Counter()
        """What has passed, and what has not: by reason."""
        self._nodes = {system_id(node): node for node in nodes}
        self._numbers: dict[int, _Numbers] = {}
        self._translation = Ardupilot() if flavor is Flavor.ARDUPILOT else None
        self._signing = signing
        self._framings: dict[object, Framing] = {}
        self._tokens, self._refilled_s = float(_BURST), 0.0

    # --- to a ground station --------------------------------------------------------------------------------------

    def out(self, node: NodeId, data: bytes) -> bytes:
        """What a UAV has said, as this link's ground stations get it; only of the flight controllers of its UAVs."""
        system = system_id(node)
        if self._nodes.get(system) != node:
            return b""
        passed = []
        for frame in frames(data):
            if frame[5] != system or frame[6] != AUTOPILOT_COMPONENT:
                continue
            told = frame if self._translation is None else self._translation.out(frame)
            passed.append(self._signed(self._numbers.setdefault(system, _Numbers()).of(told)))
        self.counts["out"] += len(passed)
        return b"".join(passed)

    def _signed(self, frame: bytes) -> bytes:
        return frame if self._signing is None else self._signing.signed(frame)

    # --- from a ground station ------------------------------------------------------------------------------------

    def into(self, peer: object, data: bytes, now_s: float, *, whole: bool) -> tuple[list[ToUav], bytes]:
        """What goes to whom of what a ground station has said (`whole`: a datagram), and what the gateway answers."""
        framing = self._framings.get(peer)
        if framing is None:
            if len(self._framings) >= _MOST_PEERS:
                self._framings.pop(next(iter(self._framings)))
            framing = self._framings[peer] = Framing(self.counts)
        self._tokens = min(float(_BURST), self._tokens + MOST_PER_S * (now_s - self._refilled_s))
        self._refilled_s = now_s
        said: dict[NodeId, list[bytes]] = {}
        answers = b""
        for frame in framing.datagram(data) if whole else framing.frames(data):
            answers += self._take(frame, said)
        return [ToUav(node, b"".join(of_node)) for node, of_node in said.items()], answers

    def _take(self, frame: Frame, said: dict[NodeId, list[bytes]]) -> bytes:
        """One frame, to those for whom it is; returns what the gateway answers in a UAV's place."""
        if self._signing is not None and not self._signing.believes(frame, self.counts):
            return b""
        if frame.system in self._uavs or not frame.system:
            self.counts["in_the_name_of_a_uav"] += 1
            return b""
        to = (
            [*self._nodes.values()]
            if not frame.target
            else [self._nodes[frame.target]]
            if frame.target in self._nodes
            else []
        )
        if not to:
            self.counts["for_nobody_here"] += 1
            return b""
        if self._tokens < len(to):
            self.counts["too_many"] += 1
            return b""
        self._tokens -= len(to)
        answer = b""
        wanted: Frame | None = frame._replace(data=unsigned(frame.data))
        if self._translation is not None and wanted is not None:
            try:
                wanted, answer = self._translation.into(wanted)
            except MalformedFrameError:
                self.counts["malformed"] += 1
                return b""
        if wanted is not None:
            self.counts["in"] += 1
            for node in to:
                said.setdefault(node, []).append(wanted.data)
        if answer:
            answer = self._signed(self._numbers.setdefault(frame.target, _Numbers()).inserted(answer))
        return answer


HOSTILE: Final = (
    "bad_crc", "bad_signature", "for_nobody_here", "in_the_name_of_a_uav", "incompatible", "lost_here", "malformed",
    "malformed_taps", "replayed", "stray_bytes", "too_many", "too_many_senders", "unknown_message", "unsigned",
)  # fmt: skip


def hostile(counts: Mapping[str, int]) -> Iterator[str]:
    """What did not pass, in words."""
    for reason in HOSTILE:
        if counts.get(reason):
            yield f"{counts[reason]} {reason.replace('_', ' ')}"
