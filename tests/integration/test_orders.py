"""What the post on the ground orders is done: whole runs of a small swarm in virtual time."""

import math
from collections.abc import Callable, Sequence

import pytest
from kit import slow

from fanet_mw.orders import Order, OrderKind
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Collided, FlightModeChanged, MissionModeChanged, Ordered, Posed, Record
from fanet_mw.units import S
from sim.run.virtual import Observed, simulate

KEYS = {
    "nodes.count": 5, "nodes.spacing_m": 40, "nodes.altitude_m": 40, "duration_s": 60, "warmup_s": 1, "drain_s": 1,
    "mission.survivors": 1, "mission.search": "lines", "mobility.model": "onboard", "mobility.speed_m_s": 7.5,
    "world.area_m": 240, "radio.range_m": 250, "traffic.arrivals": "none", "nodes.telemetry_hz": 0,
    "ground.at_m": (0.0, -150.0),
}  # fmt: skip
AT_S = 20
POST = 6


def flown(make_scenario: Callable[..., Scenario], *orders: dict[str, object], **keys: object) -> Sequence[Record]:
    return simulate(make_scenario(**{**KEYS, **keys, "orders": list(orders)})).records


def modes(records: Sequence[Record], node: int) -> list[tuple[str, float]]:
    return [(r.mode, r.t_ns / S) for r in records if isinstance(r, MissionModeChanged) and r.node == node]


def track(records: Sequence[Record], node: int) -> dict[int, Posed]:
    return {r.t_ns // S: r for r in records if isinstance(r, Posed) and r.node == node}


@pytest.mark.parametrize(("order", "mode"), [("recall", "recall"), *slow(("end", "done"))])
def test_all_fly_home_and_land_when_they_are_recalled(
    make_scenario: Callable[..., Scenario], order: str, mode: str
) -> None:
    records = flown(make_scenario, {"at_s": AT_S, "order": order}, duration_s=90)
    for node in range(1, POST):
        of_node = dict(modes(records, node))
        assert of_node[mode] == pytest.approx(AT_S, abs=2.0)
        start, *_, end = track(records, node).values()
        assert (end.east_m, end.north_m, end.up_m) == pytest.approx((start.east_m, start.north_m, 0.0), abs=9.0)
    assert {r.node for r in records if isinstance(r, Ordered)} == {1, 2, 3, 4, 5, POST}
    assert not [r for r in records if isinstance(r, Collided)]


@pytest.mark.slow
def test_one_that_is_recalled_and_released_before_it_is_home_takes_part_again(
    make_scenario: Callable[..., Scenario],
) -> None:
    orders = {"at_s": AT_S, "order": "recall", "node": 3}, {"at_s": AT_S + 6, "order": "release", "node": 3}
    records = flown(make_scenario, *orders, **{"world.base_m": (0.0, -220.0), "duration_s": 40})
    after = [mode for mode, t_s in modes(records, 3) if t_s > AT_S]
    assert after[0] == "recall"
    assert after[-1] in ("search", "respond")
    assert not [r for r in records if isinstance(r, FlightModeChanged) and r.mode == "land"]
    assert all(mode not in ("recall", "land") for node in (1, 2, 4, 5) for mode, _ in modes(records, node))


STAY_M = (80.0, -90.0)


@pytest.fixture(scope="module")
def one_stays(make_scenario: Callable[..., Scenario]) -> Sequence[Record]:
    """The flight in which somebody is to stay over a place, and all others search on."""
    return flown(make_scenario, {"at_s": AT_S, "order": "stay", "place_m": STAY_M})


def test_one_stays_over_a_place_and_the_nearest_that_can_be_spared_is_sent(one_stays: Sequence[Record]) -> None:
    chosen = next(r.other for r in one_stays if isinstance(r, Ordered))
    over = [one for t_s, one in track(one_stays, chosen).items() if t_s > AT_S + 25]
    assert max(math.hypot(one.east_m - STAY_M[0], one.north_m - STAY_M[1]) for one in over) < 12
    assert [mode for mode, _ in modes(one_stays, chosen)][-1] == "errand"


@pytest.mark.slow
def test_one_searches_around_a_place_up_to_the_radius(make_scenario: Callable[..., Scenario]) -> None:
    order = {"at_s": 15, "order": "search", "node": 2, "place_m": (0.0, 0.0), "radius_m": 80.0}
    records = flown(
        make_scenario, order, **{"sensors.camera_hz": 2.0, "sensors.camera_fov_deg": 90.0, "duration_s": 70}
    )
    around = [one for t_s, one in track(records, 2).items() if t_s > 35]
    seen = [
        (east, north) for east in range(-80, 81, 10) for north in range(-80, 81, 10) if math.hypot(east, north) <= 80
    ]
    looked = [at for at in seen if any(math.hypot(one.east_m - at[0], one.north_m - at[1]) <= 40 for one in around)]
    assert len(looked) >= 0.95 * len(seen)
    assert max(math.hypot(one.east_m, one.north_m) for one in around) < 95


def test_all_keep_out_of_an_area_that_is_closed_while_they_fly(
    make_scenario: Callable[..., Scenario], one_stays: Sequence[Record]
) -> None:
    closed_m = (30.0, -70.0)

    def inside(records: Sequence[Record]) -> set[int]:
        late = [r for r in records if isinstance(r, Posed) and r.t_ns > 45 * S]
        return {r.node for r in late if math.dist((r.east_m, r.north_m), closed_m) < 28}

    assert inside(one_stays), "they fly there otherwise"
    order = {"at_s": 25, "order": "no_fly", "place_m": closed_m, "radius_m": 30.0}
    assert not inside(flown(make_scenario, order))


def test_an_operator_orders_while_the_swarm_flies_and_what_is_impossible_is_refused_and_counted(
    make_scenario: Callable[..., Scenario],
) -> None:
    observed = Observed(make_scenario(**{**KEYS, "duration_s": 25}))
    observed.host.start()
    for at_s, order in ((15, Order(OrderKind.RECALL, 4)), (16, Order(OrderKind.RECALL, 9))):
        observed.host.run(at_s * S)
        observed.host.put(observed.names.orders, order)
    observed.host.run(25 * S)
    observed.host.stop()
    given = [r for r in observed.records if isinstance(r, Ordered) and r.node == POST]
    assert [(r.t_ns // S, r.order, r.other) for r in given] == [(15, "recall", 4)]
    assert dict(modes([*observed.records], 4))["recall"] == pytest.approx(15, abs=2)
    post = next(actor.report() for actor in observed.actors if actor.name == f"agent-{POST}")
    assert (post["orders_given"], post["orders_refused"]) == (1, 1)
