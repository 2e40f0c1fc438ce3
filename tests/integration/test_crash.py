"""A UAV that hits a building breaks: its radio goes, and the swarm sees a dead node."""

from collections.abc import Callable

from agents.uav import Uav
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, Delivered, FlightModeChanged
from fanet_mw.units import S
from sim.run.virtual import Observed

KEYS = {
    "nodes.count": 4, "nodes.spacing_m": 100, "nodes.altitude_m": 50, "duration_s": 30, "warmup_s": 1, "drain_s": 1,
    "mobility.model": "formation", "mobility.speed_m_s": 10, "world.area_m": 1000, "world.crash": "falls",
    "clusters.count": 1, "clusters.flooding_period_s": 1, "traffic.payload_bytes": 64, "radio.range_m": 400,
}  # fmt: skip


def test_who_hits_a_building_is_a_neighbor_of_nobody_any_more(make_scenario: Callable[..., Scenario]) -> None:
    tower = (120.0, 50.0, 20.0, 20.0, 90.0)  # the formation flies to the east, and one of it along here
    observed = Observed(make_scenario(**KEYS, **{"world.buildings": (tower,)}))
    host, records = observed.host, observed.records
    host.start()
    host.run(4 * S)
    uavs = [actor for actor in observed.actors if isinstance(actor, Uav)]
    assert [len(uav.state(host.now_ns).neighbors) for uav in uavs] == [3, 3, 3, 3]
    host.run(15 * S)  # the next one on its way gets there after 16 s
    (hit,) = [record for record in records if isinstance(record, Collided)]
    wreck = hit.node
    assert hit.other == 0
    assert [(r.node, r.mode) for r in records if isinstance(r, FlightModeChanged)] == [(wreck, "fallen")]
    for node, uav in enumerate(uavs, 1):
        expected = set() if node == wreck else {1, 2, 3, 4} - {node, wreck}
        assert set(uav.state(host.now_ns).neighbors) == expected
    late = {(r.origin, r.node) for r in records if isinstance(r, Delivered) and r.t_ns > hit.t_ns + 5 * S}
    assert late == {(a, b) for a in {1, 2, 3, 4} - {wreck} for b in {1, 2, 3, 4} - {wreck} if a != b}
