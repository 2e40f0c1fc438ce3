"""How a UAV's clock is brought to swarm time: not at all, by time beacons, or by GPS. Own instants in, a line out.

Not modeled of GPS: outages (they are modeled by a world without fixes), multipath, errors that last from fix to fix.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Final

from fanet_mw.bus.messages import TxOutcome, TxStatus
from fanet_mw.errors import MalformedFrameError
from fanet_mw.node.node import AnnouncedHello
from fanet_mw.node.reader import decoded, packet_of
from fanet_mw.rng import stream
from fanet_mw.scenario import Clock, Scenario
from fanet_mw.timesync.clock_fit import EXACT, ClockFit, Line, Oscillator, Pair
from fanet_mw.timesync.ftsp import Settings, TimeSync
from fanet_mw.units import LIGHT_M_PER_S, NodeId, S, seconds_to_ns
from fanet_mw.wire.inner import TimeBeacon

_SIGMAS: Final = 4
_HELLOS: Final = 8
"""The number of hellos of which the radio may yet have to tell when they ended."""
_PPM: Final = 1e-6


class SwarmTime(ABC):
    """A way to swarm time; until something better is known, the own clock is taken for it."""

    in_hellos: bool = False
    """True if hellos carry swarm time."""

    @property
    @abstractmethod
    def line(self) -> Line: ...

    @property
    @abstractmethod
    def synced(self) -> bool: ...

    @abstractmethod
    def error_ns(self, local_ns: int) -> int | None:
        """The bound of this node's error, as it is stated; None when there is none to state."""

    def worst_ns(self, local_ns: int) -> int:
        """The greatest error of any node, as far as it is known here."""
        return self.error_ns(local_ns) or 0

    def place(self, local_ns: int) -> tuple[int, int]:
        """The node whose clock is followed, and the hops to it; 0 and 0 when no node's clock is followed."""
        return 0, 0

    def start(self, local_ns: int) -> None:  # noqa: B027
        """Take in that the node has started."""

    def pass_time(self, local_ns: int) -> None:  # noqa: B027
        """Take in that time has passed."""

    def fix(self, local_ns: int, gps_ns: int) -> None:  # noqa: B027
        """Take in a position fix, which gives the true time at an own instant."""

    def on_hello(self, frame: bytes, *, ended_ns: int, local_ns: int) -> None:  # noqa: B027
        """Take in a neighbor's hello, which ended at that instant."""

    def hello_frames(self, local_ns: int) -> bytes:
        """The inner frames for the hello that is said now."""
        return b""

    def announced(self, hello: AnnouncedHello) -> None:  # noqa: B027
        """Take in that a hello of this node was announced to the radio."""

    def on_status(self, status: TxStatus, *, ended_ns: int) -> bool:
        """Take in how a transmission ended, and when; True if it was a hello whose end had to be known here."""
        return False

    def report(self) -> Mapping[str, object]:
        """The state, as JSON values."""
        return {}


class OwnTime(SwarmTime):
    """`clock.sync = "none"`: nodes follow nobody's clock, and state no error against one.

    They know how far clocks may be off by the end of the run: by how they were set, and by their data sheet.
    """

    line = EXACT
    synced = True

    def __init__(self, *, error_ns: int) -> None:
        self._error_ns = error_ns

    def error_ns(self, local_ns: int) -> int | None:
        return None

    def worst_ns(self, local_ns: int) -> int:
        return self._error_ns


class GpsTime(SwarmTime):
    """`clock.sync = "gps"`: a line through the last fixes, which also holds between and after them."""

    def __init__(self, clock: Clock, *, seed: int, node: NodeId) -> None:
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

    def report(self) -> Mapping[str, object]:
        return {"fixes": len(self._fit), "outlier": self._fit.outliers, "implausible": self._implausible}


class BeaconTime(SwarmTime):
    """`clock.sync = "beacons"`: a `TimeSync`, and its beacons in frames."""

    in_hellos = True

    def __init__(self, scenario: Scenario, node: NodeId) -> None:
        clock, radio = scenario.clock, scenario.radio
        self._node = node
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
        """The numbers of the node's hellos whose end is not known yet, by transmit request."""
        self._malformed = 0

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

    def place(self, local_ns: int) -> tuple[int, int]:
        return self._sync.reference or 0, self._sync.hops(local_ns) or 0

    def start(self, local_ns: int) -> None:
        self._sync.start(local_ns)

    def pass_time(self, local_ns: int) -> None:
        self._sync.pass_time(local_ns)

    def hello_frames(self, local_ns: int) -> bytes:
        """The time beacon, which says when the node's last hello ended."""
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

    def on_hello(self, frame: bytes, *, ended_ns: int, local_ns: int) -> None:
        """Take in a neighbor's hello. Its header names the sender; the radio's source is not passed on by every bus."""
        try:
            header = packet_of(frame).header
            beacon = decoded(frame, TimeBeacon.in_hello)
        except MalformedFrameError:
            self._malformed += 1
            return
        self._sync.on_hello(NodeId(header.prev_hop), header.seq, beacon, ended_ns=ended_ns, local_ns=local_ns)

    def report(self) -> Mapping[str, object]:
        return {**self._sync.report(), "malformed": self._malformed}


def oscillator(clock: Clock, *, others: int) -> Oscillator:
    """The bounds that a data sheet gives for the own clock, and for the clock that it follows if that drifts too."""
    rate = (1 + others) * clock.drift_ppm * _PPM
    return Oscillator(rate=rate, wander=clock.wander_ppm * _PPM, stamp_ns=clock.stamp_ns)


def swarm_time(scenario: Scenario, node: NodeId) -> SwarmTime:
    """The way to swarm time that the scenario chooses."""
    if scenario.clock.sync == "beacons":
        return BeaconTime(scenario, node)
    if scenario.clock.sync == "gps":
        return GpsTime(scenario.clock, seed=scenario.seed, node=node)
    return OwnTime(error_ns=scenario.clock.unsynchronized_error_ns(scenario.duration_ns))
