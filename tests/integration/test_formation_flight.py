"""A small swarm that flies in formation in the emulated world: over the air, with a UAV whose radio fails for good."""

import math

from fanet_mw.trace import Collided, Posed, RoleChanged
from fanet_mw.units import S
from sim.run.virtual import simulate
from sim.scenarios.catalog import find


def test_a_cluster_flies_around_its_head_and_closes_the_gap_where_one_fell_silent() -> None:
    scenario = find("convoy", [
        "nodes.count=7", "nodes.spacing_m=40", "clusters.count=1", "mission.formation_m=100", "traffic.arrivals=none",
        "nodes.telemetry_hz=0", "mission.route_m=[[600,0]]", "warmup_s=8", "duration_s=82",
        'faults=[{kind="cut",at_s=42,node=7}]',
    ])  # fmt: skip
    records = simulate(scenario).records
    at = {(r.t_ns // S, r.node): (r.east_m, r.north_m) for r in records if type(r) is Posed}
    up_m = {(r.t_ns // S, r.node): r.up_m for r in records if type(r) is Posed}
    head = next(r.node for r in records if type(r) is RoleChanged and r.role == "head")
    assert head != 7

    def widest_deg(second: int, members: list[int]) -> float:
        (east, north), places = at[second, head], [at[second, node] for node in members]
        bearings = sorted(math.degrees(math.atan2(e - east, n - north)) for e, n in places)
        return max((b - a) % 360 for a, b in zip(bearings, [*bearings[1:], bearings[0]], strict=True))

    members = [node for node in range(1, 8) if node != head]
    for second, flying in ((41, members), (81, members[:-1])):
        away = [math.dist(at[second, head], at[second, node]) for node in flying]
        assert all(abs(distance - 100) < 5 for distance in away), second
        assert widest_deg(second, flying) < 360 / len(flying) + 10, second
    assert math.dist(at[0, head], at[81, head]) > 200
    assert up_m[81, 7] > max(up_m[81, node] for node in range(1, 7)) + 8, "nobody flies into one that nobody hears"
    assert not any(type(record) is Collided for record in records)
