"""Rules by which a node decides by itself whether it passes on a flooded packet.

    all      it passes on each packet, at once
    counter  it passes on a packet after a random delay, unless it has heard enough copies by then

`counter` is after Ni et al. (MobiCom 1999, 3.2): in a sparse swarm all relay, in a dense one few do. Where a timetable
decides: `timetable/scheduled_relaying.py`. Copies and the hop limit are checked by the callers.
"""

from collections.abc import Callable
from typing import Protocol

from fanet_mw.node.packet import Packet
from fanet_mw.routing.random_assessment_delay import Assessment
from fanet_mw.scenario import Clusters
from fanet_mw.units import MS


class Rule(Protocol):
    """The decisions of one node. `open_until` is empty if the rule decides at once."""

    open_until: Assessment
    """The packets about which it is not decided yet whether they are relayed."""

    def relays_now(self, packet: Packet, *, now_ns: int) -> bool:
        """True if a new packet is relayed now; False if it is not, or if that is still open."""


class RelayAll:
    """Every packet is relayed at once."""

    def __init__(self) -> None:
        self.open_until = Assessment(enough=1)

    def relays_now(self, packet: Packet, *, now_ns: int) -> bool:
        return True


class CounterRule:
    """A packet is relayed after a random delay, unless enough other nodes have relayed it by then."""

    def __init__(self, clusters: Clusters, random: Callable[[], float]) -> None:
        self.open_until = Assessment(enough=clusters.counter)
        self._assess_ns = round(clusters.assess_ms * MS)
        self._random = random

    def relays_now(self, packet: Packet, *, now_ns: int) -> bool:
        self.open_until.first_copy(packet, due_ns=now_ns + int(self._random() * self._assess_ns))
        return False
