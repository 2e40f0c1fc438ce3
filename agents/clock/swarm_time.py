"""How a node knows swarm time, by `clock.sync`: from its own clock alone, from neighbors' time beacons, or from GPS.

Each class computes a line over the node's own clock. Fixes of GPS have independent normal noise, and no lasting errors.
"""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Final

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.duplicates import DELIVERED, DuplicateSet, hash_of
from fanet_mw.node.node import AnnouncedHello
from fanet_mw.node.reader import decoded, packet_of
from fanet_mw.rng import stream
from fanet_mw.scenario import Clock, Scenario
from fanet_mw.timesync.clock_fit import EXACT, ClockFit, Line, Oscillator, Pair
from fanet_mw.timesync.ftsp import MOST_STATED_NS, WORST_LIFE_NS, Settings, TimeSync
from fanet_mw.units import LIGHT_M_PER_S, MS, US, NodeId, S, seconds_to_ns
from fanet_mw.wire.hello.beacon import TimeBeacon

_SIGMAS: Final = 4
"""The error bound of a GPS fix, in standard deviations."""
_HELLOS: Final = 8
"""The greatest number of announced hellos that are remembered until the radio reports when they ended."""
_REMEMBERED: Final = 4096
"""The number of hellos that are remembered at least, so that none counts twice."""
OLD_NS: Final = 150 * MS
"""A hello that ended so long after the instant for which it was announced was recorded and sent again, if this node's
time is supported. Contention seldom defers a hello by a third of that."""
_QUEUED_NS: Final = S
"""A hello may wait this long at its sender."""
_PPM: Final = 1e-6


class SwarmTime:
    """How a node knows swarm time; by `clock.sync = "none"`, which is this class, by its own clock alone."""

    in_hellos: bool = False
    _error_ns: int = 0

    def __init__(self, *, error_ns: int) -> None:
        """`error_ns`: the greatest error of any clock by the end of the run, by setting and data sheet."""
        self._error_ns = error_ns

    @property
    def line(self) -> Line:
        """The line that converts an instant of the node's own clock into swarm time."""
        return EXACT

    @property
    def synced(self) -> bool:
        """True if the node has learned swarm time, or if its own clock is to be used as it is."""
        return True

    def error_ns(self, local_ns: int) -> int | None:
        """The greatest error that this node's swarm time may have now; None if the node knows no bound of it."""
        return None

    def worst_ns(self, local_ns: int) -> int:
        """The greatest error of any node's swarm time that is known here; its own bound, or 0, without news."""
        return self.error_ns(local_ns) or self._error_ns

    def reference_and_hops(self, local_ns: int) -> tuple[int, int]:
        """The node whose clock this one follows, and the hops to it; 0 and 0 if it follows none."""
        return 0, 0

    def start(self, local_ns: int) -> None:
        """The node has started."""

    def pass_time(self, local_ns: int) -> None:
        """Time has passed since the last call of any method."""

    def fix(self, local_ns: int, gps_ns: int) -> None:
        """GPS has given the time `gps_ns` at the instant `local_ns` of the node's own clock."""

    def on_hello(self, frame: bytes, src: NodeId, *, ended_ns: int, local_ns: int) -> bool:
        """A hello was received from this node, which ended at `ended_ns`; returns False if it was sent long ago."""
        return True

    def hello_frames(self, local_ns: int) -> bytes:
        """The inner frames to put into the hello that this node sends now."""
        return b""

    def announced(self, hello: AnnouncedHello) -> None:
        """A hello of this node was handed to the radio."""

    def on_status(self, status: TxStatus, *, ended_ns: int) -> bool:
        """A transmission has ended; True if that was a hello announced before (`announced`)."""
        return False

    def report(self) -> Mapping[str, object]:
        """The counters for the node's report, as JSON values."""
        return {}


class GpsTime(SwarmTime):
    """`clock.sync = "gps"`: the line is fitted to the latest fixes; between them and in an outage its error bound
    grows. Hellos state the instant at which they were made: who hears a neighbor from another time, which has refused
    that of GPS, tells the swarm that some clock has a greater error than stated.
    """

    in_hellos = True

    def __init__(self, clock: Clock, *, seed: int, node: NodeId) -> None:
        self._node = node
        self._announced: list[int] = []
        self._apart_ns: int | None = None
        """The last instant at which a node was known to be out of step."""
        self._sigma_ns = clock.gps_sigma_ns
        self._gauss = stream(seed, "gps_time", node).gauss
        self._oscillator = oscillator(clock, others=0)
        self._fit = ClockFit(self._oscillator)
        self._limit_ns = clock.limit_ns
        self._implausible = 0

    @property
    def line(self) -> Line:
        return self._fit.line or EXACT

    @property
    def synced(self) -> bool:
        return self._fit.line is not None

    def error_ns(self, local_ns: int) -> int | None:
        return self.line.error_ns(local_ns, self._oscillator) if self.synced else None

    def fix(self, local_ns: int, gps_ns: int) -> None:
        if abs(gps_ns - local_ns) > self._limit_ns:
            self._implausible += 1
            return
        stated_ns = gps_ns + round(self._gauss(0.0, self._sigma_ns))
        error_ns = math.ceil(_SIGMAS * self._sigma_ns) + self._oscillator.stamp_ns
        self._fit.add(Pair(local_ns, stated_ns - local_ns, error_ns))

    def worst_ns(self, local_ns: int) -> int:
        own_ns = min(self.error_ns(local_ns) or 0, MOST_STATED_NS)
        return MOST_STATED_NS if self._alarmed(local_ns) else own_ns

    def _alarmed(self, local_ns: int) -> bool:
        return self._apart_ns is not None and local_ns - self._apart_ns < WORST_LIFE_NS

    def on_hello(self, frame: bytes, src: NodeId, *, ended_ns: int, local_ns: int) -> bool:
        try:
            header = packet_of(frame).header
            told = decoded(frame, TimeBeacon.in_hello)
        except MalformedFrameError:
            return True  # the node counts it
        if not self.synced or not header.origin == header.prev_hop == src:
            return True
        late_ns = self.line.swarm_ns(ended_ns) - header.origin_us * US
        found_ns = [local_ns] if late_ns > max(self._limit_ns, _QUEUED_NS) or late_ns < -self._limit_ns // 2 else []
        if told is not None and told.worst_ns >= MOST_STATED_NS:
            found_ns.append(local_ns - told.worst_age_s * S)
        self._apart_ns = max([*found_ns, *([] if self._apart_ns is None else [self._apart_ns])], default=None)
        return True

    def announced(self, hello: AnnouncedHello) -> None:
        self._announced = [*self._announced[1 - _HELLOS :], hello.request]

    def on_status(self, status: TxStatus, *, ended_ns: int) -> bool:
        return status.seq in self._announced

    def hello_frames(self, local_ns: int) -> bytes:
        """Nothing, unless some node is out of step."""
        if not self.synced or self._apart_ns is None or not self._alarmed(local_ns):
            return b""
        age_s, now_ns = math.ceil((local_ns - self._apart_ns) / S), max(0, self.line.swarm_ns(local_ns))
        return TimeBeacon(now_ns, 0, 0, MOST_STATED_NS, 0, 0, self._node, self._node, min(255, age_s), 0).encode_frame(
            self._node
        )

    def report(self) -> Mapping[str, object]:
        return {"fixes": len(self._fit), "outlier": self._fit.outliers, "implausible": self._implausible}


class BeaconTime(SwarmTime):
    """`clock.sync = "beacons"`: passes neighbors' time beacons to `TimeSync`, and puts its beacons into hellos."""

    in_hellos = True

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        clock, radio = scenario.clock, scenario.radio
        self._node, self._clock = node, clock
        self._sync = TimeSync(
            Settings(
                node=node,
                leads=node == scenario.leader,
                hello_ns=seconds_to_ns(scenario.routing.hello_interval_s),
                oscillator=oscillator(clock, others=1),
                flight_ns=math.ceil(radio.range_m / LIGHT_M_PER_S * S),
                limit_ns=clock.limit_ns,
                leader=scenario.leader,
            )
        )
        self._announced: dict[int, int] = {}
        """The numbers of this node's hellos whose end was not reported yet, by the numbers of their requests."""
        self._refused: Counter[str] = Counter()
        self._heard = DuplicateSet(_REMEMBERED)

    @property
    def line(self) -> Line:
        return self._sync.line

    @property
    def synced(self) -> bool:
        return self._sync.synced

    def error_ns(self, local_ns: int) -> int | None:
        return self._sync.error_ns(local_ns)

    def worst_ns(self, local_ns: int) -> int:
        return self._sync.worst_ns(local_ns)

    def reference_and_hops(self, local_ns: int) -> tuple[int, int]:
        return self._sync.reference or 0, self._sync.hops(local_ns) or 0

    def start(self, local_ns: int) -> None:
        self._sync.start(local_ns)

    def pass_time(self, local_ns: int) -> None:
        self._sync.pass_time(local_ns)

    def hello_frames(self, local_ns: int) -> bytes:
        """The time beacon, which states the swarm time at which this node's previous hello ended."""
        beacon = self._sync.beacon(local_ns)
        return b"" if beacon is None else beacon.encode_frame(self._node)

    def announced(self, hello: AnnouncedHello) -> None:
        while len(self._announced) >= _HELLOS:
            del self._announced[next(iter(self._announced))]
        self._announced[hello.request] = hello.number

    def on_status(self, status: TxStatus, *, ended_ns: int) -> bool:
        hello = self._announced.pop(status.seq, None)
        if hello is not None and status.outcome is TxOutcome.SENT:
            self._sync.hello_sent(hello, ended_ns=ended_ns)
        return hello is not None

    def on_hello(self, frame: bytes, src: NodeId, *, ended_ns: int, local_ns: int) -> bool:
        """The first copy of a timely hello from its transmitter tells the time; False for one sent again later."""
        try:
            header = packet_of(frame).header
            beacon = decoded(frame, TimeBeacon.in_hello)
        except MalformedFrameError:
            self._refused["malformed"] += 1
            return True
        if not header.origin == header.prev_hop == src:
            self._refused["relayed"] += 1
            return True
        if self._heard.bits(packet_hash := hash_of(frame)):
            self._refused["repeated"] += 1
            return True
        self._heard.put(packet_hash, DELIVERED)
        age_ns = self.line.swarm_ns(ended_ns) - header.origin_us * US
        if age_ns > OLD_NS + self._apart_ns(local_ns):
            self._refused["old"] += 1
            self._sync.on_old_hello(src, local_ns)
            self._sync.contradicted(src, local_ns)
            return False
        if age_ns < -OLD_NS and self.synced:
            self._sync.contradicted(src, local_ns)
        self._sync.on_hello(src, header.seq, beacon, ended_ns=ended_ns, local_ns=local_ns)
        return True

    def _apart_ns(self, local_ns: int) -> float:
        """Greatest difference to a neighbor's time: 0 if others support ours, infinite once our clock has jumped,
        otherwise that of two clocks set before take-off.
        """
        if self.synced and self._sync.supported(local_ns):
            return 0
        if self._sync.counts["lost"]:
            return math.inf
        return 2 * self._clock.unsynchronized_error_ns(max(0, local_ns))

    def report(self) -> Mapping[str, object]:
        return {**self._sync.report(), **{why: self._refused[why] for why in ("malformed", *sorted(self._refused))}}


def oscillator(clock: Clock, *, others: int) -> Oscillator:
    """Bounds of the data sheet: one clock against true time (`others=0`), or two drifting ones (`others=1`)."""
    rate = (1 + others) * clock.drift_ppm * _PPM
    return Oscillator(rate=rate, wander=clock.wander_ppm * _PPM, stamp_ns=clock.stamp_ns)


def swarm_time(scenario: Scenario, node: NodeId) -> SwarmTime:
    """The way in which one node knows swarm time, by the scenario's `clock.sync`."""
    if scenario.clock.sync == "beacons":
        return BeaconTime(scenario, node)
    if scenario.clock.sync == "gps":
        return GpsTime(scenario.clock, seed=scenario.seed, node=node)
    return SwarmTime(error_ns=scenario.clock.unsynchronized_error_ns(scenario.duration_ns))
