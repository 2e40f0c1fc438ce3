"""Rejects routing headers that cannot be true, whichever node has sent them. Each first copy is checked before it has
any effect.

    origin, transmitter, destination    nodes that exist; the transmitter is the one that the radio names
    origin                              not this node, unless it knows the packet as its own
    hops                                0 only at the origin; hops made and hop limit are at most 255 together
    kind                                nobody relays a hello
    instant of generation               not in the future; unless most neighbors say so: then the own clock is behind
    sequence number                     not greater than a node had time to reach since swarm instant 0

A packet that is recorded and sent again is a copy (`duplicates.py`), or has outlived its lifetime; a hello is old after
the lifetime of frames in the radio and one hello interval, and with time beacons after 150 ms
(`agents/clock/swarm_time.py`). Origins are not proved, but a packet invented in the name of another node does not keep
out that node's own (`duplicates.hash_of`).
"""

from collections.abc import Callable
from typing import Final

from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, NodeId, S, seconds_to_ns
from fanet_mw.wire import MOST_HOPS, Fields, Kind

RESTART_STEP_NS: Final = 100 * US
"""A node sends fewer packets than one in this time, so a restarted one begins above all its earlier numbers."""
CONTROL: Final = 0x8000_0000
"""Control packets are numbered from here, so that data packets have no gaps and a lost one is noticed."""
_AHEAD_NS: Final = 100 * MS
"""How far ahead an instant of generation may be if all clocks are exact, because hosts get their time over a bus."""
_BURST: Final = 100_000
"""How far a sequence number may be beyond one packet per `RESTART_STEP_NS`: ten seconds of the densest traffic."""
_LATEST: Final = 8
"""The transmitters that decide whether the own clock is behind: those that were heard last."""
_SEVERAL: Final = 2
_STEP_US: Final = RESTART_STEP_NS // US
NUMBER: Final = CONTROL - 1
"""The bits of a sequence number that count the packets of its kind."""
_DATA: Final = int(Kind.DATA)
_HELLO: Final = int(Kind.HELLO)


class HeaderCheck:
    """The header check at one node."""

    def __init__(self, node: NodeId, scenario: Scenario, *, handed_on: Callable[[int], bool]) -> None:
        """`handed_on`: whether a data packet of this node was handed over, so that it may come back."""
        clock = scenario.clock
        self._handed_on = handed_on
        self._node = node
        self._count = scenario.node_count
        error_ns = clock.unsynchronized_error_ns(scenario.duration_ns)
        apart_ns = 2 * error_ns + S if clock.modelled else 0
        self._youngest_ns = -_AHEAD_NS - apart_ns
        """The least age of a packet, negative, because clocks differ; one from further in the future is a lie."""
        self._may_jump = clock.modelled
        self._ahead: dict[NodeId, bool] = {}
        """Whether each of the latest transmitters has sent a packet from the future, the latest last."""
        hello_ns = seconds_to_ns(scenario.routing.hello_interval_s)
        self.oldest_hello_ns: Final = scenario.mac_lifetime_ns + hello_ns + _AHEAD_NS + apart_ns
        """The greatest age of a hello, which waits in the queue of the radio and no longer than for the next one."""

    def why_not(self, fields: Fields, before: int, src: NodeId, age_ns: int) -> DropReason | None:
        """Why the header of a frame from `src` is rejected, or None. `before`: the phases in which the packet was
        handled; `age_ns`: from the stated instant of its generation to the frame's end.
        """
        _, _, origin_us, seq, origin, destination, prev_hop, kind, hop_limit, hops, _, _, _, _ = fields
        count = self._count
        if origin > count or prev_hop > count or not (destination <= count or destination == BROADCAST):
            return DropReason.UNKNOWN_NODE
        if origin == self._node and not before and not (kind == _DATA and self._handed_on(seq)):
            return DropReason.OWN
        number = seq & NUMBER
        if (
            prev_hop != src
            or (origin != prev_hop and (hops == 0 or kind == _HELLO))
            or hops + hop_limit > MOST_HOPS
            or (number > _BURST and number - _BURST > origin_us // _STEP_US)  # mostly no division
        ):
            return DropReason.FORGED
        early = age_ns < self._youngest_ns
        if self._may_jump:
            self._ahead.pop(src, None)
            self._ahead[src] = early
            if len(self._ahead) > _LATEST:
                del self._ahead[next(iter(self._ahead))]
        return DropReason.FORGED if early and not self._is_behind() else None

    def _is_behind(self) -> bool:
        """True if the own clock must have jumped back: of the latest transmitters most are ahead of it."""
        early = sum(self._ahead.values())
        return early >= _SEVERAL and 2 * early > len(self._ahead)
