"""Why each frame was sent, by the routing headers that it carries.

Of a frame with several packets the first cause counts that it holds, in the order of `Cause`. A packet that its node
has sent before is sent again, whatever for: because a neighbor lacked it, or its flood was resumed.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from enum import StrEnum
from typing import Final, NamedTuple

from emulator.pcap_reader import AirFrame
from fanet_mw import airtime
from fanet_mw.errors import MalformedFrameError
from fanet_mw.scenario import Scenario
from fanet_mw.wire import Header, Kind, decode_header
from fanet_mw.wire.aggregation import unbundle

_MAC_BYTES: Final = 24 + 36 + 4
"""What stands around a frame of the swarm: the headers of 802.11, LLC, IP and UDP, and the FCS."""


class Cause(StrEnum):
    """Why a frame was sent."""

    OWN = "own packets"
    RELAYED = "relayed"
    AGAIN = "sent again"
    CONTROL = "control"
    HELLO = "hellos"
    ACK = "ACKs"


class AirTime(NamedTuple):
    """One transmission."""

    start_ns: int
    node: int
    length_ns: int
    cause: Cause
    priority: int | None = None
    """The most urgent priority among its packets of applications; None if it carries none."""


class AirCauses:
    """Tells why frames were sent, which it is given in their order."""

    def __init__(self, scenario: Scenario, *, remembers: int | None = None) -> None:
        """`remembers`: the least number of packets, counted for each sender, that it knows again; None: all."""
        self._radio, self._remembers = scenario.radio, remembers
        self.times: Counter[tuple[int, int]] = Counter()
        """How often each packet of an application was sent lately, by all nodes together."""
        self._known: set[tuple[int, int, int]] = set()
        self._before: set[tuple[int, int, int]] = set()

    def frame(self, start_ns: int, node: int, payload: bytes, *, frame_bytes: int, attempt: int = 1) -> AirTime:
        """A transmission of a node; `payload` may be cut off, `frame_bytes` is its whole length."""
        headers = list(_headers(payload))
        causes = {self._cause_of(header, node, attempt) for header in headers}
        priority = min((header.priority for header in headers if header.kind == Kind.DATA), default=None)
        cause = next((cause for cause in Cause if cause in causes), Cause.CONTROL)
        length_ns = airtime.airtime_ns(frame_bytes + _MAC_BYTES, self._radio, rate_mbps=self._radio.rate_mbps)
        return AirTime(start_ns, node, length_ns, cause, priority)

    def ack(self, start_ns: int) -> AirTime:
        length_ns = airtime.airtime_ns(airtime.ACK_BYTES, self._radio, rate_mbps=self._radio.ack_rate_mbps)
        return AirTime(start_ns, 0, length_ns, Cause.ACK)

    def _cause_of(self, header: Header, sender: int, attempt: int) -> Cause:
        if header.kind != Kind.DATA:
            return Cause.HELLO if header.kind == Kind.HELLO else Cause.CONTROL
        self.times[header.origin, header.seq] += 1
        name = sender, header.origin, header.seq
        if name in self._known or name in self._before or attempt > 1:
            return Cause.AGAIN
        if self._remembers is not None and len(self._known) >= self._remembers:
            self._before, self._known = self._known, set()
            self.times.clear()
        self._known.add(name)
        return Cause.OWN if header.origin == sender else Cause.RELAYED


def transmissions(causes: AirCauses, frames: Iterable[AirFrame]) -> Iterator[AirTime]:
    """What a capture says was sent."""
    for one in frames:
        if one.what == "sent" and one.src is not None:
            yield causes.frame(one.t_ns, one.src, one.payload, frame_bytes=one.frame_bytes, attempt=one.attempt or 1)
        elif one.what == "ack":
            yield causes.ack(one.t_ns)


def _headers(payload: bytes) -> Iterator[Header]:
    try:
        for packet in unbundle(payload):
            yield decode_header(packet)
    except MalformedFrameError:
        return  # somebody else's frame
