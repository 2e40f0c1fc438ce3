"""The delay bound of packets in turns: rounds x hops and what surrounds each hop (docs/explanation/rounds.md, The law).

    hop = period + turn + lead + handover
    D   = ((h + margin) * hop + (1 + used) * ceil(B / room) * period / (1 - hellos)) / (1 - urgent)

`h` is the greatest number of hops to any node to which a way is known, and `margin` hops are added for a topology that
changes meanwhile. `used`, `urgent` and `hellos` (s, u and e there) are shares of turns: those that packets at least as
urgent fill, those that more urgent ones fill, and those that hellos fill. Packets in turns that are under way together,
`B` bytes (`rounds.burst_bytes`), delay each other once: every node serves them at the same rate, `room` bytes of a turn
per round (tandem of equal servers; Le Boudec and Thiran, Network Calculus, 1.4.3), the oldest first. All nodes hear the
same packets, so each computes the bytes that wait in the swarm from what it has heard itself (a leaky bucket). The law
assumes that no frame is lost; where frames are lost a likely delay is stated instead (`LikelyDelay`).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Final

from fanet_mw.routing.rounds.round_timing import RoundTiming
from fanet_mw.routing.rounds.topology import Topology
from fanet_mw.scenario import Scenario
from fanet_mw.timesync.turn_slack import clocks_fit
from fanet_mw.units import MS, US, NodeId, S, seconds_to_ns
from fanet_mw.wire import HEADER_BYTES, PRIORITIES, PRIORITY_BULK
from fanet_mw.wire.hello import PLAIN_BYTES
from fanet_mw.wire.hello.digest import MESSAGE_BYTES
from fanet_mw.wire.rounds import HEARD_BYTES

MARGIN_HOPS: Final = 2
"""The hops that are added to the known ones, for a topology that changes while a packet is under way."""
PATIENT_TURNS: Final = 2
"""A hello that found no room in so many turns goes before urgent packets."""
MOST_HOPS: Final = 32
"""A statement about links counts for the time of so many hops after the silence by which its node would be missed."""
_SILENT_HELLOS: Final = 1.6
"""The hello intervals after which a node that was not heard is missed."""
_SILENT_ROUNDS: Final = 5
"""The rounds after which it is missed where no frames are lost, if they are shorter."""
_SILENT_LEAST_NS: Final = 700 * MS
"""The least such time: the process of a node may be held up for a while."""
_SPEAKS: Final = 3
"""The number of times that a node sends something, at least, in the time after which it would be missed."""
_MOST_USED: Final = 0.75
"""No bound is stated while more than this share of `rounds.burst_bytes` waits."""
_MOST_URGENT: Final = 0.5
"""No bound is stated while more urgent packets use a greater share of turns."""
_WORSE: Final = 2
"""When the load grows, a packet waits up to so many times as long as those that were heard lately."""
_WINDOWS: Final = 2
"""The usual load is smoothed: the newest window weighs one part in so many."""
_HELLO_BYTES: Final = PLAIN_BYTES + MESSAGE_BYTES
"""The length of a hello with one message of a digest."""
_MOST_HELLOS: Final = 1 / (1 + PATIENT_TURNS)
"""The greatest share of turns that hellos take from packets beside which they do not fit."""
_MOST_HELLOS_ALONE: Final = 0.9
"""The same where each hello has a turn of its own."""
_KEPT: Final = 0.997
"""The share of received packets whose ratio of delay to way is not exceeded. It is above `LIKELY_SHARE`, because some
copies never arrive, and have no ratio.
"""
_FEWEST: Final = 300
"""The number of packets of others that are heard before a delay is stated."""
_MOST: Final = 800
"""Beyond this number of packets all counts are halved, so that older packets weigh less."""
_STEPS: Final = 8
"""The steps into which a ratio of 1 is divided."""
_GREATEST: Final = 16
"""Ratios from about this one on are counted together, and no delay is stated by them."""


class DelayLaw:
    """The bound that one node states."""

    def __init__(self, timing: RoundTiming, scenario: Scenario) -> None:
        self._timing = timing
        self._clock, self._slack_ns = scenario.clock, round(scenario.rounds.turn_slack_us * US)
        self.loses_frames = scenario.radio.channel != "range" or scenario.radio.fading != "none"
        self.kept_bytes = min(HEADER_BYTES + HEARD_BYTES, timing.turn_bytes // 2)
        """The bytes of a turn that are kept for news of links, which urgent packets must not crowd out."""
        self._room = timing.turn_bytes - self.kept_bytes
        self._burst_turns = -(-scenario.rounds.burst_bytes // self._room)
        self._burst_ns = self._burst_turns * timing.period_ns
        self.hop_ns = timing.period_ns + timing.turn_ns + scenario.radio.lead_ns + scenario.radio.handover_ns
        if scenario.clock.sync == "beacons":
            self.hop_ns += timing.period_ns  # hellos have turns of their own
        hello_ns = seconds_to_ns(scenario.routing.hello_interval_s) or S
        missed_ns = round(_SILENT_HELLOS * hello_ns)
        self.found_ns = missed_ns + self.hop_ns
        """The time after which a node has heard every node that is near, because each has sent a hello."""
        if not self.loses_frames:  # else several frames in a row may be lost
            missed_ns = min(missed_ns, max(_SILENT_ROUNDS * timing.period_ns, _SILENT_LEAST_NS))
        self.silent_ns = missed_ns + self.hop_ns
        """A node that was not heard for so long is no neighbor any more."""
        self.speaks_ns = missed_ns // _SPEAKS
        """A node that has sent nothing for so long uses its turn though it has nothing new."""
        self.epoch_ns = max(hello_ns // 4, 1)
        """The interval at which a node may state its neighbors anew."""
        self._waiting_bytes = 0.0
        """The bytes of packets for turns that wait in the swarm."""
        self._greatest = 0
        """The size of the greatest of these packets [bytes]."""
        self._counted_ns = 0
        """The instant for which `_waiting_bytes` was computed."""
        self._hellos_alone = scenario.clock.sync == "beacons"
        """Whether each hello has a turn of its own, because the clock must know its end."""
        most = _MOST_HELLOS_ALONE if self._hellos_alone else _MOST_HELLOS
        self._hello_share = min(timing.period_ns / hello_ns, most) if scenario.routing.hello_interval_s else 0.0
        self._window_ns = max(self._burst_ns, timing.period_ns)
        """The load is measured over windows of this length."""
        self._window = 0
        """The number of the present window."""
        self._came: defaultdict[int, float] = defaultdict(float)
        self._came_before: Mapping[int, float] = {}
        """The turns filled, by priority, by packets that came in the present window and in the one before."""
        self._usually: dict[int, float] = {}
        """The turns that packets of each priority fill in a window, smoothed over the windows before this one."""
        self._waited_ns: defaultdict[int, int] = defaultdict(int)
        self._waited_before_ns: Mapping[int, int] = {}
        """The longest that a packet has waited for turns on its way, by priority, in this window and the one before."""
        self._stated = self._stated_turns(scenario)
        """The turns of a round that packets fill by the scenario, by priority."""

    def count(self, size: int, *, priority: int, now_ns: int) -> None:
        """A packet for turns was made here, or received."""
        self._turn_window(now_ns)
        self._came[priority] += self.turns_of(size)
        self._serve(now_ns)
        self._waiting_bytes += size
        self._greatest = max(self._greatest, size)

    def hear(self, delay_ns: int, *, hops: int, priority: int, now_ns: int) -> None:
        """A packet of another node took so long over so many hops; what exceeds the time of the hops is waiting."""
        self._turn_window(now_ns)
        self._waited_ns[priority] = max(self._waited_ns[priority], delay_ns - hops * self.hop_ns)

    def _waited(self, priority: int) -> int:
        waits = (*self._waited_before_ns.items(), *self._waited_ns.items())
        return max((waited_ns for other, waited_ns in waits if other <= priority), default=0)

    def _serve(self, now_ns: int) -> None:
        """Take off the waiting bytes what the rounds since `_counted_ns` have carried: one turn's worth each."""
        left = 1 - self._hellos(self._greatest)
        served = left * self._sure_bytes * (now_ns - self._counted_ns) / self._timing.period_ns
        self._waiting_bytes -= served
        self._counted_ns = now_ns
        if self._waiting_bytes <= 0:
            self._waiting_bytes, self._greatest = 0.0, 0

    @property
    def _sure_bytes(self) -> int:
        """The least bytes of waiting packets that a full turn carries: none is divided, so its end may be empty."""
        return max(1, self._room - self._greatest + 1)

    def _hellos(self, size: int) -> float:
        """The share of turns that hellos take from packets of `size` bytes."""
        beside = not self._hellos_alone and _HELLO_BYTES + size <= self._timing.turn_bytes
        return self._hello_share * (_HELLO_BYTES / self._timing.turn_bytes if beside else 1)

    def _turn_window(self, now_ns: int) -> None:
        window = now_ns // self._window_ns
        if window != self._window:
            passed = max(1, window - self._window)  # the swarm's time may step back
            for priority in self._usually.keys() | self._came.keys():
                usual = self._usually.get(priority, 0.0)
                usual += (self._came[priority] - usual) / _WINDOWS
                self._usually[priority] = usual * (1 - 1 / _WINDOWS) ** (passed - 1)
            self._came_before = self._came if passed == 1 else {}
            self._waited_before_ns = self._waited_ns if passed == 1 else {}
            self._waited_ns = defaultdict(int)
            self._came, self._window = defaultdict(float), window

    def _urgent_share(self, priority: int, now_ns: int) -> float:
        """The share of turns that packets more urgent than `priority` have used lately."""
        self._turn_window(now_ns)
        passed = now_ns % self._window_ns / self._window_ns
        before, came = (
            sum(turns for other, turns in counted.items() if other < priority)
            for counted in (self._came_before, self._came)
        )
        return max(before, (1 - passed) * before + came) / (self._window_ns / self._timing.period_ns)

    def _used_share(self, priority: int) -> float:
        """The share of turns that packets at least as urgent as `priority` fill: usually, or by the scenario if that is
        more.
        """
        used = sum(turns for other, turns in self._usually.items() if other <= priority)
        stated = sum(turns for other, turns in self._stated.items() if other <= priority)
        return max(used * self._timing.period_ns / self._window_ns, stated)

    def _stated_turns(self, scenario: Scenario) -> Mapping[int, float]:
        """The turns of a round that the traffic of the scenario fills, by priority."""
        found: defaultdict[int, float] = defaultdict(float)
        for traffic in scenario.traffic_classes.values():
            priority = PRIORITIES[traffic.priority]
            if priority < PRIORITY_BULK or not self._timing.slots:
                turns = self.turns_of(traffic.longest_bytes) * self._timing.period_ns / S
                found[priority] += traffic.rate_hz(scenario.node_count) * turns
        return found

    def bound_ns(
        self, topology: Topology, *, priority: int, clock_error_ns: int, now_ns: int, size: int = 0
    ) -> int | None:
        """The bound for a packet of `size` bytes handed over now, clocks within `clock_error_ns`; None if none can be
        stated. Over a channel that loses frames it holds for packets that lose none.
        """
        if not clocks_fit(self._clock, slack_ns=self._slack_ns, clock_error_ns=clock_error_ns):
            return None
        self._serve(now_ns)
        if self._waiting_bytes > _MOST_USED * self._burst_turns * self._sure_bytes:
            return None
        if self.absent(topology, now_ns=now_ns) is None:
            return None
        hops, urgent = topology.hops(now_ns), self._urgent_share(priority, now_ns)
        if len(hops) == 1 or urgent > _MOST_URGENT:
            return None
        farthest, used = max(hops.values()), self._used_share(priority)
        if used > 1:
            return None
        found_ns = self.over_ns(farthest, longest_bytes=max(size, self._greatest), used=used)
        if _WORSE * self._waited(priority) > found_ns - self.way_ns(farthest):
            return None  # more waits elsewhere than this node has heard
        return round(found_ns / (1 - urgent))

    def over_ns(self, hops: int, *, longest_bytes: int, used: float = 0.0) -> int:
        """The bound over so many hops if nothing more urgent comes, and no packet under way exceeds `longest_bytes`;
        `used`: the share of turns that packets at least as urgent fill.
        """
        return self.way_ns(hops) + round((1 + used) * self._burst_ns / (1 - self._hellos(longest_bytes)))

    def turns_of(self, size: int) -> float:
        """The turns that a packet of `size` bytes fills, if it shares them with hellos and packets of the same size."""
        return 1 / max(1, self._room // size) / (1 - self._hellos(size))

    def way_ns(self, hops: int) -> int:
        """The bound over so many hops if nothing else waits."""
        return (hops + MARGIN_HOPS) * self.hop_ns

    def absent(self, topology: Topology, *, now_ns: int) -> Sequence[NodeId] | None:
        """The nodes to which a bound does not apply, because no way leads to them; None while one may yet be found."""
        return topology.absent(now_ns, doubt_ns=self.found_ns)


class LikelyDelay:
    """The delay within which nearly all copies of a node's packets arrive: the time that the way to the farthest node
    takes if nothing is lost and nothing waits, x the ratio of delay to such a time that few packets of others have
    exceeded lately. Assumed: packets take as long to the others as from them.
    """

    def __init__(self) -> None:
        self._counts = [0.0] * (_STEPS * _GREATEST)
        self._total = 0.0

    def hear(self, delay_ns: int, *, way_ns: int) -> None:
        """A packet took so long over a way that takes `way_ns` if nothing is lost and nothing waits."""
        step = max(0, delay_ns) * _STEPS // way_ns
        self._counts[min(step, len(self._counts) - 1)] += 1
        self._total += 1
        if self._total > _MOST:
            self._counts = [count / 2 for count in self._counts]
            self._total = sum(self._counts)

    def over_ns(self, way_ns: int) -> int | None:
        """The delay that is likely over such a way; None if too little is known."""
        rest = total = self._total
        if total < _FEWEST:
            return None
        for step, count in enumerate(self._counts[:-1]):
            rest -= count
            if rest <= (1 - _KEPT) * total:
                return way_ns * (step + 1) // _STEPS
        return None
