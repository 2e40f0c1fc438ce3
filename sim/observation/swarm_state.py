"""The state of a swarm as an observer knows it: fed with what is heard on the bus, or with the records of a trace.

Shares of delivery are those of packets that had time to arrive: older than the longest delay seen lately, and sent
within `LATELY_NS` before that.
"""

import math
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from agents.applications.traffic import targets_of
from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.errors import ConfigError, MalformedFrameError
from fanet_mw.graph.topology import components
from fanet_mw.mavlink import common, decode
from fanet_mw.scenario import Scenario
from fanet_mw.trace import (
    BoundExcludes,
    BoundStated,
    Delivered,
    Dropped,
    FlightModeChanged,
    Generated,
    MissionModeChanged,
    Posed,
    RadioFault,
    Record,
    RoleChanged,
)
from fanet_mw.units import MS, STILL, Enu, NodeId, S
from fanet_mw.wire import FOUND, frames
from fanet_mw.wire.frame import Content, message_id
from fanet_mw.wire.survivors import Found, Standing
from sim.observation.event_text import event_line
from sim.observation.observer import Observer
from sim.observation.turns import Turns, turns
from sim.results.mission import CoveredCells, SurvivorStates
from sim.results.packets import OTHER_APPS
from sim.world.environment.survivors import place

LATELY_NS: Final = 10 * S
_LEAST_SETTLING_NS: Final = 2 * S
_MOST_SETTLING_NS: Final = 20 * S
_PERIODS: Final = 3
"""A flood over clusters may take so many of their periods; while nothing has arrived yet, no delay says so."""
_MARGIN: Final = 1.2
"""A packet counts when it is so many times as old as the longest delay lately."""
_REMEMBERED_NS: Final = _MOST_SETTLING_NS + LATELY_NS + 2 * S
_LINKS_NS: Final = 4 * S
_MOST_EVENTS: Final = 200
_TRAIL: Final = 60
"""The number of places of a trail, one a second."""
_BATTERY_ID: Final = 1
"""SYS_STATUS of MAVLink, whose byte 30 is the charge in percent, -1: unknown."""
_HEADER_BYTES: Final = 10
_BATTERY_AT: Final = 30
_ACK_ID: Final = int(common.MAVLINK_MSG_ID_COMMAND_ACK)


@dataclass(slots=True)
class UavNow:
    """One UAV."""

    position: Enu
    velocity: Enu = STILL
    flight: str = ""
    mission: str = ""
    survivor: int = 0
    """The survivor to whom it responds; 0 for none."""
    role: str = ""
    cluster: int = -1
    head: int = 0
    charge_percent: int | None = None
    posed_ns: int = 0
    """The instant of its position."""
    heard_ns: int = 0
    """When its process was last heard of."""
    delivered: int = 0
    sent: int = 0
    """Packets that its applications received and sent, since observation began."""
    drops: Counter[str] = field(default_factory=Counter)
    """Packets that ended inside it, by reason, duplicates aside."""
    trail: deque[Enu] = field(default_factory=lambda: deque(maxlen=_TRAIL))
    yaw_rad: float = 0.0
    """The direction of its flight, from north clockwise; kept while it hovers."""
    acceleration: Enu = STILL
    said: dict[int, "Said"] = field(default_factory=dict)
    """What its MAVLink has carried, by message id."""


class Said(NamedTuple):
    """The messages of one kind on a UAV's tap."""

    number: int
    first_ns: int
    last_ns: int


class Copy(NamedTuple):
    """A packet at one node."""

    t_ns: int
    delay_ns: int
    hops: int


@dataclass(slots=True)
class PacketNow:
    """A packet of the last seconds."""

    born_ns: int
    app: str = ""
    targets: int = 0
    meant: frozenset[int] | None = None
    """The nodes at which its copies count; None: all, as it is not known for whom it is meant."""
    bound_ns: int = 0
    excluded: set[int] = field(default_factory=set)
    """The nodes for which the bound does not hold, because the origin takes them to be gone."""
    got: dict[int, Copy] = field(default_factory=dict)

    def copies(self) -> dict[int, Copy]:
        """Its copies at nodes for which it is meant."""
        if self.meant is None:
            return self.got
        return {node: copy for node, copy in self.got.items() if node in self.meant}

    def bounded_delays_ns(self) -> list[int]:
        """The delays of the copies for which the bound holds."""
        return [copy.delay_ns for node, copy in self.copies().items() if node not in self.excluded]

    def broken(self) -> int:
        """The copies that came later than the bound, or never, once it is over."""
        delays = self.bounded_delays_ns()
        wanted = len(delays) if self.meant is None else len(self.meant - self.excluded)
        return wanted - sum(delay_ns <= self.bound_ns for delay_ns in delays)


class Estimate(NamedTuple):
    """Where a UAV says that a survivor is."""

    t_ns: int
    survivor: int
    node: int
    east_m: float
    north_m: float
    sigma_m: float
    """The standard deviation in the worst direction."""
    standing: str


class _CopiesCounted(NamedTuple):
    """The copies of frames at stations in range since the start, and, by reason, how many of them were lost."""

    t_ns: int
    on_air: int
    lost: Mapping[str, int]


class Event(NamedTuple):
    """What happened, for people."""

    t_ns: int
    node: int
    text: str


class SwarmState(Observer):
    """What is known of one swarm at `t_ns`."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.t_ns = 0
        self.uavs: dict[int, UavNow] = {}
        self.reports: dict[int, Mapping[str, Any]] = {}
        self.emulator: Mapping[str, Any] = {}
        self._air: deque[tuple[int, float]] = deque()
        """Instants, and the time [ns] for which the air was busy until then, of the last seconds."""
        self._copies: deque[_CopiesCounted] = deque()
        """The reports of the emulator of the last seconds; each counts since the start."""
        self.packets: dict[tuple[int, int], PacketNow] = {}
        self.estimates: dict[int, Estimate] = {}
        self.events: deque[Event] = deque(maxlen=_MOST_EVENTS)
        self.told = 0
        """The number of events so far."""
        self.faults: dict[str, RadioFault] = {}
        """The faults on the air that last, by label."""
        self.turns: Turns | None = turns(scenario, {})
        self.time_scale = 1.0
        periods_ns = _PERIODS * scenario.clusters.period_ns if scenario.routing.protocol == "clustered" else 0
        self._least_settling_ns = min(_MOST_SETTLING_NS, max(_LEAST_SETTLING_NS, periods_ns))
        self.settling_ns = self._least_settling_ns
        """A packet counts as sent when it is this old; whoever has not got it by then has lost it."""
        self.broken = 0
        """Copies of packets that came later than the bound of their packet, or never."""
        self._app = next(iter(scenario.traffic_classes))
        self._meant: dict[tuple[str, int], frozenset[int] | None] = {}
        self._links: deque[LinkStats] = deque()
        self._cells = CoveredCells(scenario)
        self._by_poses = False
        self._pruned_ns = 0
        self._trailed_ns = -S
        try:
            self.places: Sequence[Enu] = place(scenario)
        except ConfigError:
            self.places = ()  # its map is gone
        self.survivors = SurvivorStates(self.places)

    # --- what is heard --------------------------------------------------------------------------------------------

    def take_poses(self, poses: Poses) -> None:
        self._by_poses = True
        if poses.t_ns < self.t_ns - S:
            return
        for row, node in enumerate(poses.ids):
            east, north, up, *velocity = poses.states[6 * row : 6 * row + 6]
            self._moved(node, Enu(east, north, up), Enu(*velocity), poses.t_ns)
        self._advance(poses.t_ns)

    def take_records(self, records: Iterable[Record]) -> None:
        for record in records:
            match record:
                case Delivered():
                    self._delivered(record)
                case Generated():
                    self._generated(record)
                case BoundStated():
                    self._packet(record.node, record.seq, record.t_ns).bound_ns = record.bound_ns
                case BoundExcludes():
                    self._packet(record.node, record.seq, record.t_ns).excluded.add(record.other)
                case Posed():
                    if not self._by_poses:
                        self._posed(record)
                case _:
                    self._changed(record)
            if record.t_ns > self.t_ns:
                self._advance(record.t_ns)

    def take_links(self, stats: LinkStats) -> None:
        self._links.append(stats)
        while self._links[0].t_ns <= stats.t_ns - _LINKS_NS:
            self._links.popleft()

    def take_report(self, name: str, content: Mapping[str, Any], *, t_ns: int) -> None:
        if name == "emulator":
            self.emulator = content
            self._hear_air(content, t_ns)
            self._hear_copies(content, t_ns)
        elif name.startswith("agent-"):
            node = int(name.removeprefix("agent-"))
            self.reports[node] = content
            uav = self.uavs.get(node)
            if uav is not None:
                uav.heard_ns = max(t_ns, uav.heard_ns)
                if not uav.role and content.get("role"):  # taken before observation began
                    uav.role, uav.cluster = content["role"], content.get("cluster") or 0
                    uav.head = content.get("head") or 0
            if content.get("slots") or content.get("turns"):
                self.turns = turns(self.scenario, self.reports)

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None:
        """MAVLink bytes of a UAV: its battery, and finds of survivors that it has sent or received."""
        try:
            for frame in frames(data):
                kind = message_id(frame)
                if node in self.uavs:
                    self._said(self.uavs[node], kind, t_ns)
                if kind == FOUND.msgid:
                    self._found(Found.decode_frame(Content(((kind, frame),))), t_ns)
                elif kind == _BATTERY_ID and node in self.uavs:
                    self.uavs[node].charge_percent = _charge_percent(frame)
                elif kind == _ACK_ID and (refusal := _refusal(frame)):
                    self._tell(Event(t_ns, node, f"UAV {node} {refusal}"))
        except MalformedFrameError:
            return  # telemetry of a foreign program; the collector of the run counts it

    # --- what is known --------------------------------------------------------------------------------------------

    def link_rows(self) -> Iterator[tuple[int, int, int, int]]:
        """Each directed link with traffic in the last seconds: source, destination, copies, received."""
        found: dict[tuple[int, int], list[int]] = {}
        for stats in self._links:
            if stats.t_ns <= self.t_ns - _LINKS_NS:
                continue
            for row in stats.rows():
                sums = found.setdefault((row.src, row.dst), [0, 0])
                sums[0] += row.copies
                sums[1] += row.received
        for (src, dst), (copies, received) in found.items():
            yield src, dst, copies, received

    def neighbors(self) -> dict[NodeId, tuple[NodeId, ...]]:
        """Of each node those who received at least half of what it sent lately, and it of what they sent."""
        shares = {(src, dst): received / max(1, copies) for src, dst, copies, received in self.link_rows()}
        near: dict[NodeId, list[NodeId]] = {NodeId(node): [] for node in sorted(self.uavs)}
        for src, dst in sorted(shares):
            if shares[src, dst] >= 0.5 and shares.get((dst, src), 0) >= 0.5:
                near.setdefault(NodeId(src), []).append(NodeId(dst))
        return {node: tuple(others) for node, others in near.items()}

    def parts(self) -> list[tuple[NodeId, ...]] | None:
        """The UAVs as parts of which no two hear each other; None while nobody is known to hear anybody."""
        near = self.neighbors()
        return components(near) if any(near.values()) else None

    def lately(self) -> list[tuple[tuple[int, int], PacketNow]]:
        """The packets of the traffic's first class that had time to arrive, of the ten seconds before."""
        last_ns = self.t_ns - self.settling_ns
        first_ns = last_ns - LATELY_NS
        return [
            (name, one)
            for name, one in self.packets.items()
            if one.app == self._app and first_ns <= one.born_ns <= last_ns
        ]

    def bounded(self) -> list[PacketNow]:
        """The packets with a stated bound, of any application, that had their time to arrive lately."""
        since_ns = self.t_ns - self.settling_ns - LATELY_NS
        return [
            one for one in self.packets.values() if one.bound_ns and since_ns <= one.born_ns <= self.t_ns - one.bound_ns
        ]

    def newest(self, *, by_ns: int) -> tuple[tuple[int, int], PacketNow] | None:
        """The latest packet that was sent by an instant, of those that anybody received."""
        known = [(one.born_ns, name) for name, one in self.packets.items() if one.born_ns <= by_ns and one.got]
        if not known:
            return None
        _, name = max(known)
        return name, self.packets[name]

    def latest_events(self, count: int) -> list[Event]:
        return list(self.events)[-count:] if count > 0 else []

    def heads(self) -> dict[int, list[int]]:
        """The members of each cluster by its head."""
        found: dict[int, list[int]] = {}
        for node, uav in sorted(self.uavs.items()):
            if uav.head:
                found.setdefault(uav.head, []).append(node)
        return found

    def owners(self, t_ns: int) -> list[int]:
        """The UAVs whose turn it is; a slot is the turn of the head of its cluster."""
        if self.turns is None:
            return []
        owners = self.turns.owners(t_ns)
        if self.turns.called == "turn":
            return owners
        return [node for node, uav in sorted(self.uavs.items()) if uav.role == "head" and uav.cluster in owners]

    def covered(self) -> npt.NDArray[np.bool_]:
        """The cells of the area that UAVs have flown over, rows from south to north."""
        return self._cells.seen

    def metrics(self) -> dict[str, float | None]:
        """The figures of the swarm now; None for what is not known."""
        packets = self.lately()
        wanted = sum(one.targets for _, one in packets)
        delays = sorted(copy.delay_ns for _, one in packets for copy in one.copies().values())
        bounded = self.bounded()
        kept = sorted(delay_ns for one in bounded for delay_ns in one.bounded_delays_ns())
        air, late = self.emulator.get("air", {}), self.emulator.get("late", {})
        (since_ns, before_ns), (until_ns, after_ns) = (self._air[0], self._air[-1]) if self._air else ((0, 0), (0, 0))
        return {
            "delivered_share": len(delays) / wanted if wanted else None,
            "delay_p50_ms": delays[len(delays) // 2] / MS if delays else None,
            "delay_p95_ms": delays[math.ceil(len(delays) * 0.95) - 1] / MS if delays else None,
            "delay_max_ms": delays[-1] / MS if delays else None,
            "bounded_p95_ms": kept[math.ceil(len(kept) * 0.95) - 1] / MS if kept else None,
            "bounded_max_ms": kept[-1] / MS if kept else None,
            "bound_max_ms": max(one.bound_ns for one in bounded) / MS if bounded else None,
            "bounds_broken": self.broken,
            "airtime_share": air.get("busy"),
            "airtime_lately_share": (after_ns - before_ns) / (until_ns - since_ns) if until_ns > since_ns else None,
            "late_share": late.get("late_frames", 0) / max(1, late.get("frames", 0)) if late else None,
            "late_p99_ms": late.get("p99_ms"),
            "time_scale": self.time_scale,
            "confirmed": self.survivors.count("confirmed"),
            "survivors": len(self.survivors.now),
            "coverage_share": self._cells.share,
            "waiting_packets": sum(report.get("waiting", 0) for report in self.reports.values()),
        }

    def losses(self) -> Mapping[str, float]:
        """The share of the copies at stations in range that was lost lately, by reason; empty if that is not known."""
        if len(self._copies) < 2:
            return {}
        before, now = self._copies[0], self._copies[-1]
        copies = max(1, now.on_air - before.on_air)
        return {reason: (count - before.lost.get(reason, 0)) / copies for reason, count in now.lost.items()}

    # --- parts ----------------------------------------------------------------------------------------------------

    def _moved(self, node: int, position: Enu, velocity: Enu, t_ns: int) -> None:
        uav = self.uavs.get(node)
        if uav is None:
            self.uavs[node] = uav = UavNow(position, velocity, posed_ns=t_ns)
        span_s = (t_ns - uav.posed_ns) / S
        if 0 < span_s < 1:
            change = velocity.minus(uav.velocity)
            uav.acceleration = Enu(change.east / span_s, change.north / span_s, change.up / span_s)
        uav.position, uav.velocity, uav.posed_ns = position, velocity, t_ns
        if velocity.horizontal() >= 0.5:
            uav.yaw_rad = math.atan2(velocity.east, velocity.north)

    def _posed(self, record: Posed) -> None:
        position = Enu(record.east_m, record.north_m, record.up_m)
        uav = self.uavs.get(record.node)
        velocity = position.minus(uav.position) if uav is not None else STILL  # they come once a second
        self._moved(record.node, position, velocity, record.t_ns)

    def _advance(self, t_ns: int) -> None:
        self.t_ns = max(self.t_ns, t_ns)
        if self.t_ns >= self._trailed_ns + S:
            self._trailed_ns = self.t_ns
            for uav in self.uavs.values():
                uav.trail.append(uav.position)
            self._cells.add([uav.position for node, uav in self.uavs.items() if node != self.scenario.post])
        if self.t_ns >= self._pruned_ns + S:
            self._pruned_ns = self.t_ns
            self._forget()

    def _forget(self) -> None:
        longest_ns = max(
            (copy.delay_ns for one in self.packets.values() if one.app == self._app for copy in one.got.values()),
            default=0,
        )
        self.settling_ns = min(_MOST_SETTLING_NS, max(self._least_settling_ns, round(_MARGIN * longest_ns)))
        for name, one in list(self.packets.items()):
            if one.born_ns < self.t_ns - _REMEMBERED_NS:
                del self.packets[name]
                if one.bound_ns:
                    self.broken += one.broken()

    def _packet(self, origin: int, seq: int, born_ns: int) -> PacketNow:
        found = self.packets.get((origin, seq))
        if found is None:
            self.packets[origin, seq] = found = PacketNow(born_ns)
        return found

    def _generated(self, record: Generated) -> None:
        one = self._packet(record.node, record.seq, record.t_ns)
        one.born_ns, one.app = record.t_ns, record.app
        key = (record.app, record.node)
        if key not in self._meant:
            self._meant[key] = self._meant_for(*key)
        one.meant = self._meant[key]
        one.targets = self.scenario.node_count - 1 if one.meant is None else len(one.meant)
        self._heard(record.node, record.t_ns)
        if record.node in self.uavs:
            self.uavs[record.node].sent += 1

    def _meant_for(self, app: str, origin: int) -> frozenset[int] | None:
        if app in self.scenario.traffic_classes:
            return frozenset(targets_of(self.scenario, origin, app))
        return frozenset(self.scenario.node_ids) - {origin} if app in OTHER_APPS else None

    def _delivered(self, record: Delivered) -> None:
        one = self._packet(record.origin, record.seq, record.t_ns - record.delay_ns)
        one.got.setdefault(record.node, Copy(record.t_ns, record.delay_ns, record.hops))
        self._heard(record.node, record.t_ns)
        if record.node in self.uavs:
            self.uavs[record.node].delivered += 1

    def _heard(self, node: int, t_ns: int) -> None:
        uav = self.uavs.get(node)
        if uav is not None and t_ns > uav.heard_ns:
            uav.heard_ns = t_ns

    def _changed(self, record: Record) -> None:
        uav = self.uavs.setdefault(record.node, UavNow(STILL)) if record.node else None
        match record:
            case RoleChanged() if uav is not None:
                uav.role, uav.cluster, uav.head = record.role, record.cluster, record.head
            case FlightModeChanged() if uav is not None:
                uav.flight = record.mode
            case MissionModeChanged() if uav is not None:
                uav.mission, uav.survivor = record.mode, record.survivor
            case Dropped() if uav is not None:
                uav.drops[record.reason] += 1
            case RadioFault():
                if record.active:
                    self.faults[record.label] = record
                else:
                    self.faults.pop(record.label, None)
            case _:
                self.survivors.take(record)
        if text := event_line(record):
            self._tell(Event(record.t_ns, record.node, text))

    def _tell(self, event: Event) -> None:
        self.events.append(event)
        self.told += 1

    @staticmethod
    def _said(uav: UavNow, kind: int, t_ns: int) -> None:
        known = uav.said.get(kind)
        uav.said[kind] = Said(1, t_ns, t_ns) if known is None else Said(known.number + 1, known.first_ns, t_ns)

    def _hear_air(self, content: Mapping[str, Any], t_ns: int) -> None:
        """The emulator reports the share of the time since the warm-up ended, or before that since the start."""
        share = content.get("air", {}).get("busy")
        begins_ns, ends_ns = self.scenario.traffic_window_ns
        if share is None or t_ns > ends_ns:
            return
        since_ns = begins_ns if t_ns > begins_ns else 0
        busy_ns = share * (t_ns - since_ns)
        if self._air and (busy_ns < self._air[-1][1] or t_ns <= self._air[-1][0]):
            self._air.clear()  # the warm-up has ended
        self._air.append((t_ns, busy_ns))
        while self._air[0][0] < t_ns - _LINKS_NS - S:
            self._air.popleft()

    def _hear_copies(self, content: Mapping[str, Any], t_ns: int) -> None:
        """The emulator reports how many copies of frames stations in range were to get, and which were lost."""
        copies = content.get("copies", {})
        if "on_air" not in copies:
            return
        counted = _CopiesCounted(t_ns, copies["on_air"], copies.get("lost", {}))
        if self._copies and (counted.on_air < self._copies[-1].on_air or t_ns <= self._copies[-1].t_ns):
            self._copies.clear()  # the emulator, or the time that is looked at, has begun anew
        self._copies.append(counted)
        while self._copies[0].t_ns < t_ns - _LINKS_NS - S:
            self._copies.popleft()

    def _found(self, found: Found, t_ns: int) -> None:
        known = self.estimates.get(found.survivor)
        if known is not None and known.t_ns > found.t_us * 1000:
            return
        if found.standing is Standing.REFUTED:
            self.estimates.pop(found.survivor, None)
            return
        self.estimates[found.survivor] = Estimate(
            min(found.t_us * 1000, t_ns), found.survivor, found.node, found.east_m, found.north_m, found.sigma_m,
            found.standing.name.lower(),
        )  # fmt: skip


def _charge_percent(frame: bytes) -> int | None:
    """The charge in a SYS_STATUS; zeros at the end of a message are not sent (MAVLink 2, payload truncation)."""
    payload = frame[_HEADER_BYTES : _HEADER_BYTES + frame[1]]
    percent = int.from_bytes(payload[_BATTERY_AT : _BATTERY_AT + 1], "little", signed=True)
    return percent if percent >= 0 else None


def _refusal(frame: bytes) -> str:
    """What a UAV says to a command that it does not carry out; empty for one that it accepts."""
    (ack,) = decode(frame)
    if ack.result == common.MAV_RESULT_ACCEPTED:
        return ""
    command, result = (
        name.name.removeprefix(f"{kind}_").lower().replace("_", " ")
        if (name := common.enums[kind].get(value)) is not None
        else str(value)
        for kind, value in (("MAV_CMD", ack.command), ("MAV_RESULT", ack.result))
    )
    return f"does not {command}: {result}"
