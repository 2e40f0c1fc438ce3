"""What one node with its own station can do to the others over the air: each attack that once worked, by name.

Of nine nodes, the one in the middle attacks; all others hear it, or hear one that does. Promised: nothing raises,
nobody computes without end, the books close, packets that nobody sent are no deliveries, and the others still reach
each other.
"""

import random
import time
from collections.abc import Callable, Mapping
from typing import Any

import pytest
import scenario_draws
from attacker import Attacker, Plan, packet

from agents.autopilot import Autopilot
from fanet_mw import wire
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, Kind
from fanet_mw.wire.claims import Claims, HeardNeighbor, SlotStatus
from fanet_mw.wire.digest import Digest, Holding
from fanet_mw.wire.inner import Beacon, Join, Member, Role, Schedule, Survivor, TimeBeacon
from fanet_mw.wire.links import Link, Links
from sim.scenarios import catalog

EVIL = NodeId(5)
HONEST = [node for node in range(1, 10) if node != EVIL]
KEYS = (
    "nodes.count=9", "nodes.spacing_m=120", "duration_s=24", "warmup_s=8", "drain_s=2", "mobility.model=static",
    "world.engine=kinematic", "mission.survivors=0", f"traffic.sources={HONEST[1:]}", f"traffic.targets={HONEST}",
    "nodes.telemetry_hz=0",
)  # fmt: skip
CONTROL = 0x8000_0000


def scenario(*more: str) -> Scenario:
    return catalog.find("quick", [*KEYS, *more])


def attacked(found: Scenario, plan: Plan) -> tuple[Mapping[str, Any], dict[str, Any]]:
    """Summary and reports of a run under attack."""
    reports: dict[str, Any] = {}
    summary = scenario_draws.run(found, limit_s=60, instead=[Attacker(EVIL, found.name, plan)], reports=reports)
    assert summary["frames"]["closes"], summary["frames"]
    return summary, reports


def dropped(reports: Mapping[str, Any], reason: str) -> int:
    """By all honest nodes."""
    return sum(reports[f"agent-{node}"]["dropped"].get(reason, 0) for node in HONEST)


def hello(t_ns: int, seq: int, *inner: bytes, node: int = EVIL) -> bytes:
    positions = Autopilot(NodeId(node), position=Enu(0, 0, 50), telemetry_hz=0).beacon_frames(t_ns)
    return packet(
        positions + b"".join(inner), by=node, t_ns=t_ns, seq=CONTROL + seq, kind=Kind.HELLO, flags=0, hop_limit=1,
        priority=wire.PRIORITY_CONTROL,
    )  # fmt: skip


def beacon(**fields: int) -> bytes:
    return Beacon(**{
        "node": EVIL, "head": 0, "head_seq": 0, "cluster": 0, "epoch": 0, "slot": 0, "role": Role.ISOLATED,
        "hops_to_head": 255, "term": 0, "leader": 0, **fields,
    }).encode_frame(EVIL)  # fmt: skip


def every(step_ms: float, make: Callable[[int, int], bytes], *, start_s: float = 9, end_s: float = 20) -> Plan:
    """One frame a step, at no fixed phase: what is in step with slots destroys frames whatever it says."""
    jitter = random.Random(step_ms).random
    count = int((end_s - start_s) * 1000 / step_ms)
    times = [round(start_s * S + (at + jitter()) * step_ms * MS) for at in range(count)]
    return [(t_ns, make(t_ns, at)) for at, t_ns in enumerate(times)]


# --- what is bounded where it is decoded ---------------------------------------------------------------------------


@pytest.mark.parametrize("rssi_dbm", [1e10, -1e10, 1e38, -300.0, 300.0])
@pytest.mark.parametrize("far_m", [0.0, 3e38, 9.9e6])
def test_survivors_of_any_power_at_any_place_end_no_process(rssi_dbm: float, far_m: float) -> None:
    def report(t_ns: int, seq: int) -> bytes:
        reporter = 1 + seq % 9
        inner = Survivor(t_ns // 1000, seq % 4, reporter, Enu(far_m, -far_m, 0), rssi_dbm).encode_frame(reporter)
        return packet(inner, by=EVIL, t_ns=t_ns, seq=1000 + seq, origin=reporter)

    summary, reports = attacked(scenario(), every(50, report))
    assert summary["pdr"] > 0.97
    if abs(rssi_dbm) > 300 or far_m > 1e7:
        assert dropped(reports, "malformed") > 0


def test_a_report_in_another_s_name_than_its_packet_s_is_malformed() -> None:
    def report(t_ns: int, seq: int) -> bytes:
        return packet(Survivor(0, 1, 1 + seq % 4, Enu(0, 0, 0), -60).encode_frame(1), by=EVIL, t_ns=t_ns, seq=seq)

    summary, reports = attacked(scenario("mission.survivors=1"), every(200, report))
    assert dropped(reports, "malformed") >= 8
    assert summary["mission"]["uavs_approaching"] == 0


def test_a_digest_that_is_ahead_by_half_of_all_numbers_costs_nothing() -> None:
    def lie(t_ns: int, seq: int) -> bytes:
        ahead = (0x7FFF_FFFF, 0x8000_0000, 0x8000_0001, 0xFFFF_FFFF, 40)[seq % 5]
        holdings = tuple(Holding(node, ahead, 0xFFFF_FFFF) for node in range(1, 10))
        return hello(t_ns, seq, beacon(), Digest(holdings, complete=True).encode_frames(EVIL))

    began = time.process_time()
    summary, _ = attacked(scenario("clusters.repair_s=20"), every(100, lie))
    assert summary["pdr"] > 0.97
    assert time.process_time() - began < 30


def test_sequence_numbers_of_the_far_future_are_refused_and_cost_nothing() -> None:
    def leap(t_ns: int, seq: int) -> bytes:
        return packet(wire.filler(100), by=EVIL, t_ns=t_ns, seq=0x4000_0000 + 77 * seq, origin=1 + seq % 9)

    began = time.process_time()
    summary, reports = attacked(scenario("clusters.repair_s=20"), every(50, leap))
    assert dropped(reports, "forged") > 100
    assert summary["pdr"] > 0.97
    assert time.process_time() - began < 30


def test_a_join_of_a_head_from_255_hops_away_ends_nobody() -> None:
    def join(t_ns: int, seq: int) -> bytes:
        origin = 1 + seq % 9
        inner = Join(origin, Enu(100, 0, 50), Enu(0, 0, 0)).encode_frame(origin)
        return packet(
            inner, by=EVIL, t_ns=t_ns, seq=CONTROL + 5000 + seq, origin=origin, kind=Kind.JOIN, hops=255 - seq % 3,
            hop_limit=seq % 3,
        )  # fmt: skip

    summary, _ = attacked(scenario(), every(100, join))
    assert summary["pdr"] > 0.9


# --- who is not there ----------------------------------------------------------------------------------------------


def test_ghosts_do_not_join() -> None:
    def ghost(t_ns: int, seq: int) -> bytes:
        origin = 10 + seq
        inner = Join(origin, Enu(seq, seq, 50), Enu(0, 0, 0)).encode_frame(origin)
        return packet(inner, by=EVIL, t_ns=t_ns, seq=CONTROL + seq, origin=origin, kind=Kind.JOIN)

    began = time.process_time()
    summary, reports = attacked(scenario(), every(2, ghost))
    assert dropped(reports, "unknown_node") > 5000
    assert reports["agent-1"]["epoch"] <= 5
    assert summary["pdr"] > 0.9
    assert time.process_time() - began < 45


@pytest.mark.parametrize("relay", ["cds", "mpr", "heads", "claimed"])
def test_nobody_hears_of_neighbors_that_are_not_there(relay: str) -> None:
    def lie(t_ns: int, seq: int) -> bytes:
        heard = tuple(HeardNeighbor(NodeId(100 + k), SlotStatus(), hears_us=True) for k in range(16))
        return hello(t_ns, seq, beacon(), Claims(EVIL, SlotStatus(), heard).encode_frames())

    summary, reports = attacked(scenario(f"clusters.relay={relay}"), every(200, lie))
    assert dropped(reports, "malformed") > 50
    assert summary["pdr"] > 0.9


def test_a_leader_s_links_of_nodes_that_are_not_there_are_refused() -> None:
    def lie(t_ns: int, seq: int) -> bytes:
        link = Link(NodeId(3), NodeId(10), grade=100, power_dbm=-60)
        inner = Links(1, (link,)).encode_frames()
        return packet(inner, by=EVIL, t_ns=t_ns, seq=CONTROL + 9000 + seq, origin=1, kind=Kind.LINKS)

    summary, reports = attacked(scenario("clusters.relay=scheduled", "clusters.links=measured"), every(200, lie))
    assert dropped(reports, "malformed") > 50
    assert summary["pdr"] > 0.9


# --- in another's name ---------------------------------------------------------------------------------------------


def forged_schedule(t_ns: int, seq: int, *, epoch: int, leader: int = 1, term: int = 0) -> bytes:
    members = tuple(Member(node, 0, node == EVIL) for node in (EVIL, 2, 3))
    inner = Schedule(t_ns // 1000, 1_000_000, 1_000_000, epoch, leader, 1, 0, 1, members, term).encode_frame(leader)
    return packet(inner, by=EVIL, t_ns=t_ns, seq=CONTROL + seq, origin=leader, kind=Kind.SCHEDULE)


def test_schedules_in_the_leader_s_name_that_leap_in_epoch_are_refused() -> None:
    plan = every(1000, lambda t_ns, seq: forged_schedule(t_ns, 900 + seq, epoch=30_000), end_s=13)
    summary, reports = attacked(scenario(), plan)
    assert dropped(reports, "malformed") >= 20
    assert summary["pdr"] > 0.97


def test_a_leader_answers_a_schedule_in_its_name_by_a_later_one() -> None:
    plan = every(1000, lambda t_ns, seq: forged_schedule(t_ns, 900 + seq, epoch=9 + seq), end_s=12)
    summary, reports = attacked(scenario("duration_s=30"), plan)
    assert dropped(reports, "own") > 0
    assert reports["agent-1"]["epoch"] > 9
    assert [reports[f"agent-{node}"]["epoch"] for node in HONEST] == [reports["agent-1"]["epoch"]] * len(HONEST)
    assert summary["pdr"] > 0.8, "for three of twenty seconds nodes obeyed another"


@pytest.mark.parametrize("protocol", ["clustered", "flooding", "counter", "gossip"])
def test_sequences_played_before_their_owner_mute_nobody_and_are_no_deliveries(protocol: str) -> None:
    """Node 9's next hundred packets, in its name and passed on by the attacker; its own come after them."""
    keys = (f"routing.protocol={protocol}", "traffic.sources=[9]", "clock.sync=none", "traffic.interval_s=0.5")

    def earlier(t_ns: int, seq: int) -> bytes:
        return packet(
            wire.filler(220, node=9), by=EVIL, t_ns=t_ns, seq=seq % 60, origin=9, priority=wire.PRIORITY_BULK,
            flags=FLAG_FLOOD if protocol == "clustered" else 0,
        )  # fmt: skip

    calm = attacked(scenario(*keys), [])[0]
    summary, _ = attacked(scenario(*keys), every(50, earlier, start_s=6, end_s=18))
    assert summary["unknown"] > 200
    assert summary["delivered"] <= summary["generated"] * 7
    worst = 0.1 if protocol == "gossip" else 0.05  # by lot, a relay more or less is one of a few
    assert summary["pdr"] > calm["pdr"] - worst


def test_who_transmits_in_another_s_name_is_refused() -> None:
    def hello_of_another(t_ns: int, seq: int) -> bytes:
        return hello(t_ns, seq, beacon(node=1), node=1 + seq % 4)

    summary, reports = attacked(scenario(), every(100, hello_of_another))
    assert dropped(reports, "forged") + dropped(reports, "own") > 400
    assert summary["pdr"] > 0.97


# --- time ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [2, 3, 5])
def test_time_beacons_from_the_start_do_not_pull_the_swarm_s_time_apart(seed: int) -> None:
    said: list[int] = []

    def lie(t_ns: int, seq: int) -> bytes:
        """Each says of the one before it that it ended 46 ms later than it did, by the word of the reference."""
        said.append(t_ns)
        time = TimeBeacon(said[max(0, seq - 1)] + 46 * MS, 0, 0, 0, CONTROL + seq - 1, seq, EVIL, 1, 0, 1)
        return hello(t_ns, seq, beacon(), time.encode_frame(EVIL) if seq else b"")

    keys = ("clock.sync=beacons", "clock.offset_ms=5", "clock.drift_ppm=20", f"seed={seed}")
    summary, _ = attacked(scenario(*keys), every(300, lie, start_s=0.1, end_s=22))
    assert summary["clock"]["error_us"]["max"] < 40
    assert summary["clock"]["beyond_bound"] <= 0.4 * summary["clock"]["samples"]
    assert summary["pdr"] > 0.97
