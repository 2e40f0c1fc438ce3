"""The delay bound of packets in turns: rounds x hops, with what surrounds each hop.

    hop = period + turn + lead + handover
    D   = (h + margin) * hop + ceil(B / room) * period

A packet that was heard is announced one lead before the next own turn, at most one period later; its frame ends within
the turn, and is handed over. `h` is the greatest distance that the node knows to another; `margin` is for a topology
that changes meanwhile. All urgent packets that are under way together, `B` bytes, delay each other once: every node
serves them at the same rate, `room` bytes of a frame per round, so what waited for one node's turn does not wait
again for the next one's (tandem of equal servers; Le Boudec and Thiran, Network Calculus, 1.4.3).
Assumed: no frame is lost, so over any channel but `range` no bound is stated. None is stated either while clocks may be
further apart than the slack of turns holds, while more was heard than the turns of that time carry, or of late more
than three quarters of what they carry, or while a node has been out of reach for less than the silence by which it is
known to be gone; nodes gone for longer are not among those to which a bound applies.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.routing.rounds.topology import Topology
from fanet_mw.scenario import Scenario
from fanet_mw.timesync.turn_slack import clocks_fit
from fanet_mw.units import US, NodeId, S, seconds_to_ns
from fanet_mw.wire import HEADER_BYTES
from fanet_mw.wire.rounds import HEARD_BYTES

MARGIN_HOPS: Final = 2
MOST_HOPS: Final = 32
"""The hops for which a statement about links lives at least."""
_SILENT_HELLOS: Final = 1.6
_LATELY: Final = 4
"""What came within so many times that in which a burst is served came lately."""
_MOST_USED: Final = 0.75


class DelayLaw:
    """The bound that one node states."""

    def __init__(self, timing: RoundTiming, scenario: Scenario) -> None:
        self._timing = timing
        self._clock, self._slack_ns = scenario.clock, round(scenario.rounds.turn_slack_us * US)
        self._loses_frames = scenario.radio.channel != "range" or scenario.radio.fading != "none"
        self.kept_bytes = min(HEADER_BYTES + HEARD_BYTES, timing.turn_bytes // 2)
        """The part of a turn that is kept for news of links, which urgent packets must not crowd out."""
        self._room = timing.turn_bytes - self.kept_bytes
        self._burst_turns = -(-scenario.rounds.burst_bytes // self._room)
        self._burst_ns = self._burst_turns * timing.period_ns
        self.hop_ns = timing.period_ns + timing.turn_ns + scenario.radio.lead_ns + scenario.radio.handover_ns
        if scenario.clock.sync == "beacons":
            self.hop_ns += timing.period_ns  # hellos have turns of their own
        hello_ns = seconds_to_ns(scenario.routing.hello_interval_s) or S
        self.silent_ns = round(_SILENT_HELLOS * hello_ns) + self.hop_ns
        """A neighbor that was not heard for so long is none."""
        self.epoch_ns = max(hello_ns // 4, 1)
        self._recent: deque[tuple[int, int]] = deque()
        """(instant, size) of the urgent packets that came lately."""

    def count(self, size: int, *, now_ns: int) -> None:
        """An urgent packet came, own or another node's."""
        self._recent.append((now_ns, size))

    def bound_ns(self, topology: Topology, *, clock_error_ns: int, now_ns: int) -> int | None:
        """The bound for a packet that is handed over now, if all clocks are within `clock_error_ns`; None if none can
        be stated.
        """
        if not clocks_fit(self._clock, slack_ns=self._slack_ns, clock_error_ns=clock_error_ns):
            return None
        while self._recent and self._recent[0][0] < now_ns - _LATELY * self._burst_ns:
            self._recent.popleft()
        sizes = [size for at_ns, size in self._recent if at_ns >= now_ns - self._burst_ns]
        if self._turns_for(sizes) > self._burst_turns:
            return None
        if self._turns_for([size for _, size in self._recent]) > _MOST_USED * _LATELY * self._burst_turns:
            return None
        if self.absent(topology, now_ns=now_ns) is None:
            return None
        hops = topology.hops(now_ns)
        return self.over_ns(max(hops.values())) if len(hops) > 1 else None

    def _turns_for(self, sizes: Sequence[int]) -> int:
        """The turns that packets need at most: none is divided, so the end of each turn may be empty."""
        sure = self._room - max(sizes, default=0) + 1
        return min(len(sizes), -(-sum(sizes) // sure)) if sure > 0 else len(sizes)

    def over_ns(self, hops: int) -> int | None:
        """The bound over so many hops; None if the channel loses frames."""
        return None if self._loses_frames else (hops + MARGIN_HOPS) * self.hop_ns + self._burst_ns

    def absent(self, topology: Topology, *, now_ns: int) -> Sequence[NodeId] | None:
        """The nodes to which a bound does not apply, because they are gone; None while some may just have gone."""
        return topology.absent(now_ns, doubt_ns=self.silent_ns)
