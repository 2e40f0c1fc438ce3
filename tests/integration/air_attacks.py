"""The attacks of one node with its own station: what each sends, as plans of frames.

Of nine nodes, the one in the middle attacks; all others hear it, or hear one that does. `ATTACKS` has one of each for
the table of attacks, and for a swarm of real processes.
"""

import random
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from attacker import Plan, packet

from agents.applications.telemetry_streams import TelemetryStreams
from fanet_mw import wire
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, Kind
from fanet_mw.wire.hello.beacon import Beacon, Role, TimeBeacon
from fanet_mw.wire.hello.digest import Digest, Holding
from fanet_mw.wire.links import Link, Links
from fanet_mw.wire.schedule import Join, Member, Schedule
from fanet_mw.wire.survivors import Survivor
from sim.scenarios import catalog

EVIL: Final = NodeId(5)
HONEST: Final = [node for node in range(1, 10) if node != EVIL]
_KEYS: Final = (
    "nodes.count=9", "nodes.spacing_m=120", "duration_s=24", "warmup_s=8", "drain_s=2", "mobility.model=static",
    "world.engine=kinematic", "mission.survivors=0", f"traffic.sources={HONEST[1:]}", f"traffic.targets={HONEST}",
    "nodes.telemetry_hz=0",
)  # fmt: skip
_CONTROL: Final = 0x8000_0000
_SINCE_S: Final = 9


def scenario(*more: str) -> Scenario:
    return catalog.find("quick", [*_KEYS, *more])


def hello(t_ns: int, seq: int, *inner: bytes, node: int = EVIL) -> bytes:
    positions = TelemetryStreams(NodeId(node), position=Enu(0, 0, 50), telemetry_hz=0).beacon_frames(t_ns)
    return packet(
        positions + b"".join(inner), by=node, t_ns=t_ns, seq=_CONTROL + seq, kind=Kind.HELLO, flags=0, hop_limit=1,
        priority=wire.PRIORITY_CONTROL,
    )  # fmt: skip


def beacon(**fields: int) -> bytes:
    return Beacon(**{
        "node": EVIL, "head": 0, "head_seq": 0, "cluster": 0, "epoch": 0, "slot": 0, "role": Role.ISOLATED,
        "hops_to_head": 255, "term": 0, "leader": 0, **fields,
    }).encode_frame(EVIL)  # fmt: skip


def every(step_ms: float, make: Callable[[int, int], bytes], *, start_s: float = _SINCE_S, end_s: float = 20) -> Plan:
    """One frame a step, at no fixed phase: what is in step with slots destroys frames whatever it says."""
    jitter = random.Random(step_ms).random
    count = int((end_s - start_s) * 1000 / step_ms)
    times = [round(start_s * S + (at + jitter()) * step_ms * MS) for at in range(count)]
    return [(t_ns, make(t_ns, at)) for at, t_ns in enumerate(times)]


# --- what is bounded where it is decoded ---------------------------------------------------------------------------


def survivors(rssi_dbm: float = 1e10, far_m: float = 0.0) -> Plan:
    """Reports of any power at any place, in everybody's name."""

    def report(t_ns: int, seq: int) -> bytes:
        reporter = 1 + seq % 9
        inner = Survivor(t_ns // 1000, seq % 4, reporter, Enu(far_m, -far_m, 0), rssi_dbm).encode_frame(reporter)
        return packet(inner, by=EVIL, t_ns=t_ns, seq=1000 + seq, origin=reporter)

    return every(50, report)


def reports_of_others() -> Plan:
    """Survivor reports that name another reporter than their packet has for its origin."""

    def report(t_ns: int, seq: int) -> bytes:
        return packet(Survivor(0, 1, 1 + seq % 4, Enu(0, 0, 0), -60).encode_frame(1), by=EVIL, t_ns=t_ns, seq=seq)

    return every(200, report)


def digests_far_ahead() -> Plan:
    def lie(t_ns: int, seq: int) -> bytes:
        ahead = (0x7FFF_FFFF, 0x8000_0000, 0x8000_0001, 0xFFFF_FFFF, 40)[seq % 5]
        holdings = tuple(Holding(node, ahead, 0xFFFF_FFFF) for node in range(1, 10))
        return hello(t_ns, seq, beacon(), Digest(holdings, complete=True).encode_frames(EVIL))

    return every(100, lie)


def far_sequences() -> Plan:
    def leap(t_ns: int, seq: int) -> bytes:
        return packet(wire.filler(100), by=EVIL, t_ns=t_ns, seq=0x4000_0000 + 77 * seq, origin=1 + seq % 9)

    return every(50, leap)


def joins_from_afar() -> Plan:
    """Joins of heads that are 255 hops away."""

    def join(t_ns: int, seq: int) -> bytes:
        origin = 1 + seq % 9
        inner = Join(origin, Enu(100, 0, 50), Enu(0, 0, 0)).encode_frame(origin)
        return packet(
            inner, by=EVIL, t_ns=t_ns, seq=_CONTROL + 5000 + seq, origin=origin, kind=Kind.JOIN, hops=255 - seq % 3,
            hop_limit=seq % 3,
        )  # fmt: skip

    return every(100, join)


# --- who is not there ----------------------------------------------------------------------------------------------


def ghosts(step_ms: float = 2) -> Plan:
    """Joins of thousands of nodes."""

    def ghost(t_ns: int, seq: int) -> bytes:
        origin = 10 + seq
        inner = Join(origin, Enu(seq, seq, 50), Enu(0, 0, 0)).encode_frame(origin)
        return packet(inner, by=EVIL, t_ns=t_ns, seq=_CONTROL + seq, origin=origin, kind=Kind.JOIN)

    return every(step_ms, ghost)


def ghost_links() -> Plan:
    """Links of a node that is not there, in the leader's name."""

    def lie(t_ns: int, seq: int) -> bytes:
        link = Link(NodeId(3), NodeId(10), grade=100, power_dbm=-60)
        inner = Links(1, (link,)).encode_frames()
        return packet(inner, by=EVIL, t_ns=t_ns, seq=_CONTROL + 9000 + seq, origin=1, kind=Kind.LINKS)

    return every(200, lie)


# --- in another's name ---------------------------------------------------------------------------------------------


def forged_schedule(t_ns: int, seq: int, *, epoch: int, leader: int = 1, term: int = 0) -> bytes:
    members = tuple(Member(node, 0, node == EVIL) for node in (EVIL, 2, 3))
    inner = Schedule(t_ns // 1000, 1_000_000, 1_000_000, epoch, leader, 1, 0, 1, members, term).encode_frame(leader)
    return packet(inner, by=EVIL, t_ns=t_ns, seq=_CONTROL + seq, origin=leader, kind=Kind.SCHEDULE)


def schedules_that_leap() -> Plan:
    return every(1000, lambda t_ns, seq: forged_schedule(t_ns, 900 + seq, epoch=30_000), end_s=13)


def next_schedules() -> Plan:
    return every(1000, lambda t_ns, seq: forged_schedule(t_ns, 900 + seq, epoch=9 + seq), end_s=12)


def earlier_sequences(*, clustered: bool = True) -> Plan:
    """Node 9's next packets, in its name and passed on by the attacker; its own come after them."""

    def earlier(t_ns: int, seq: int) -> bytes:
        return packet(
            wire.filler(220, node=9), by=EVIL, t_ns=t_ns, seq=seq % 60, origin=9, priority=wire.PRIORITY_BULK,
            flags=FLAG_FLOOD if clustered else 0,
        )  # fmt: skip

    return every(50, earlier, start_s=6, end_s=18)


def hellos_of_others() -> Plan:
    return every(100, lambda t_ns, seq: hello(t_ns, seq, beacon(node=1), node=1 + seq % 4))


# --- time ----------------------------------------------------------------------------------------------------------


def false_time() -> Plan:
    """From the start on: each beacon says of the one before it that it ended 46 ms later than it did, by the word of
    the reference."""
    said: list[int] = []

    def lie(t_ns: int, seq: int) -> bytes:
        said.append(t_ns)
        time = TimeBeacon(said[max(0, seq - 1)] + 46 * MS, 0, 0, 0, _CONTROL + seq - 1, seq, EVIL, 1, 0, 1)
        return hello(t_ns, seq, beacon(), time.encode_frame(EVIL) if seq else b"")

    return every(300, lie, start_s=0.1, end_s=22)


CLOCKS: Final = ("clock.sync=beacons", "clock.offset_ms=5", "clock.drift_ppm=20")


class Attack(NamedTuple):
    """One attack as a row of a table."""

    promise: str
    plan: Callable[[], Plan]
    keys: tuple[str, ...] = ()
    """What the swarm needs besides to have something to lose."""


ATTACKS: Final[Mapping[str, Attack]] = {
    "none": Attack("", list),
    "survivor reports of 1e10 dBm, as everybody": Attack("`malformed` beyond 300 dBm; no process ends", survivors),
    "survivor reports 3e38 m away": Attack(
        "`malformed` beyond 10,000 km; no process ends", lambda: survivors(-60.0, 3e38)
    ),
    "survivor reports that name another reporter": Attack("`malformed`; nobody flies there", reports_of_others),
    "digests of sequences far ahead": Attack(
        "no more work than for any hello; nothing is repaired for them", digests_far_ahead, ("clusters.repair_s=20",)
    ),
    "sequence numbers of the far future": Attack("`forged`", far_sequences, ("clusters.repair_s=20",)),
    "joins of heads 255 hops away": Attack("`forged` if their hops cannot be; no process ends", joins_from_afar),
    "500 joins a second of nodes that are not there": Attack("`unknown_node`; the leader counts none of them", ghosts),
    "links of a node that is not there, as the leader": Attack(
        "`malformed`", ghost_links, ("clusters.relay=scheduled", "clusters.links=measured")
    ),
    "schedules as the leader, epoch 30,000": Attack("`malformed`: no leap of more than 16 epochs", schedules_that_leap),
    "schedules as the leader, the next epochs": Attack(
        "the leader hears them (`own`) and announces a later one; until then they are obeyed", next_schedules,
        ("duration_s=30",),
    ),
    "packets of node 9 before it sends them": Attack(
        "nobody's packets are kept out; the forged are `unknown` and no deliveries", earlier_sequences,
        ("traffic.sources=[9]", "traffic.interval_s=0.5"),
    ),
    "hellos in the name of others": Attack("`forged`, `own`", hellos_of_others),
    "false time from the start on": Attack(
        "needs the word of a second neighbor, or nobody's contradiction", false_time, CLOCKS
    ),
}  # fmt: skip
"""By what the attacker sends; the first row is the swarm without it."""
