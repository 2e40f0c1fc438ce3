"""What a routing header cannot truly say, whichever node sent it: the check of every first copy, before it has effects.

    origin, transmitter, destination    nodes that there are; the transmitter is the one that the radio names
    hops                                0 at the origin alone; with those still allowed, no more than 255
    instant of birth                    not still to come
    sequence number                     not beyond those that the time since swarm instant 0 has room for

Frames that cannot be decoded are counted as `malformed` by the node (`node.py`), a packet that was recorded and is sent
again is a copy (`duplicates.py`) or has outlived its lifetime (`expired`, `node.py`).

Not here: proof of origin. A relay may still invent a packet in the name of a node behind it; what it cannot do is keep
out that node's own packets, because a packet is known by its content and not by its name alone (`reader.Reader`).
"""

from typing import Final

from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, US, NodeId, S
from fanet_mw.wire import MOST_HOPS, Fields, Kind

RESTART_STEP_NS: Final = 100 * US
"""A node sends fewer packets than one per 0.1 ms, so a later start begins beyond all earlier sequence numbers."""
CONTROL: Final = 0x8000_0000
"""Control packets are numbered apart, from here on: then data packets have no gaps, and what is missing shows."""
_AHEAD_NS: Final = 100 * MS
"""A birth may lie so far ahead where all clocks are exact: hosts take their time from each other over a bus."""
_BURST_NS: Final = 100_000 * RESTART_STEP_NS
"""The time for which numbers may be ahead of one per `RESTART_STEP_NS`: ten seconds of the densest traffic."""
_NUMBER: Final = CONTROL - 1
"""The bits of a sequence number that count the packets of its kind."""
_HELLO: Final = int(Kind.HELLO)


class HeaderCheck:
    """The check of headers at one node."""

    def __init__(self, node: NodeId, scenario: Scenario) -> None:
        clock = scenario.clock
        self._node = node
        self._count = scenario.nodes.count
        error_ns = clock.unsynchronized_error_ns(scenario.duration_ns)
        self._ahead_ns = _AHEAD_NS + (2 * error_ns + S if clock.modelled else 0)

    def why_not(self, fields: Fields, known: bool, src: NodeId, end_ns: int) -> DropReason | None:
        """The reason why the header of a frame that `src` sent until `end_ns` is not believed; None: it is believed.

        `known`: the packet was handled before, in another phase.
        """
        _, _, origin_us, seq, origin, destination, prev_hop, kind, hop_limit, hops, _, _, _, _ = fields
        count, born_ns = self._count, origin_us * US
        if origin > count or prev_hop > count or not (destination <= count or destination == BROADCAST):
            return DropReason.UNKNOWN_NODE
        if origin == self._node and not known:
            return DropReason.OWN
        if (
            prev_hop != src
            or (origin != prev_hop and (hops == 0 or kind == _HELLO))
            or hops + hop_limit > MOST_HOPS
            or born_ns > end_ns + self._ahead_ns
            or (seq & _NUMBER) * RESTART_STEP_NS > born_ns + _BURST_NS
        ):
            return DropReason.FORGED
        return None
