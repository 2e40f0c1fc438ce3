"""What befalls single UAVs in a swarm that flies: crashes, weak batteries, wrong positions, programs that end."""

import json
from collections.abc import Mapping

import pytest

from fanet_mw.scenario import config
from fanet_mw.trace import Delivered, FlightModeChanged, Generated, MissionModeChanged, Posed, RadioFault
from fanet_mw.units import S
from sim.results.files import finish
from sim.results.outcome import Outcome
from sim.run.virtual import simulate
from sim.scenarios import catalog

SMALL = (
    "nodes.count=5", "clusters.count=1", "nodes.spacing_m=80", "duration_s=28", "warmup_s=1", "drain_s=1",
    "mission.survivors=1", "mission.search=spiral", "world.area_m=600",
)  # fmt: skip


def flown(*faults: Mapping[str, object], keys: tuple[str, ...] = ()) -> Outcome:
    tree = catalog.find("rescue", [*SMALL, *keys]).model_dump(mode="json", exclude_none=True)
    return simulate(config.build({**tree, "faults": json.loads(json.dumps(faults))}))


STOPS = ({"at_s": 7, "kind": "stop", "node": 3, "for_s": 8}, {"at_s": 15, "kind": "stop", "node": 5})


@pytest.fixture(scope="module")
def plain() -> Outcome:
    return flown()


@pytest.fixture(scope="module")
def stopped() -> Outcome:
    return flown(*STOPS)


def begun(outcome: Outcome) -> list[tuple[float, int, str, bool]]:
    return [(r.t_ns / S, r.node, r.kind, r.active) for r in outcome.records if isinstance(r, RadioFault)]


def born(outcome: Outcome, node: int) -> list[float]:
    return [r.t_ns / S for r in outcome.records if isinstance(r, Generated) and r.node == node]


def test_who_crashes_falls_and_its_radio_dies_on_the_ground() -> None:
    outcome = flown({"at_s": 8, "kind": "crash", "node": 3}, keys=("duration_s=18",))
    crash, cut = begun(outcome)
    assert crash == (8.0, 3, "crash", True)
    assert cut[1:] == (3, "cut", True)
    assert 11 < cut[0] < 13, "it falls 65 m"
    assert [r.mode for r in outcome.records if isinstance(r, FlightModeChanged) and r.node == 3][-1] == "fallen"
    assert not [r for r in outcome.records if isinstance(r, Delivered) and r.node == 3 and r.t_ns > (cut[0] + 0.5) * S]
    summary = finish(outcome, out=None)
    assert summary["mission"]["connected"] == 1.0, "the dead need no connection"
    assert summary["frames"]["closes"]


@pytest.mark.slow
def test_a_weak_battery_takes_a_uav_home() -> None:
    fault = {"at_s": 8, "kind": "battery", "node": 3, "charge": 0.16}
    outcome = flown(fault, keys=("sensors.battery_hz=1", "duration_s=26"))
    left_s = {r.node: r.t_ns / S for r in outcome.records if isinstance(r, MissionModeChanged) and r.mode == "return"}
    assert set(left_s) == {3}
    assert 8 <= left_s[3] <= 24


@pytest.mark.slow
def test_a_program_that_ends_says_nothing_and_takes_part_again_when_it_is_started_anew(stopped: Outcome) -> None:
    outcome = stopped
    assert set(begun(outcome)) == {(7.0, 3, "stop", True), (15.0, 3, "stop", False), (15.0, 5, "stop", True)}
    assert not [t_s for t_s in born(outcome, 3) if 7 <= t_s < 15]
    assert [t_s for t_s in born(outcome, 3) if t_s > 15]
    assert max(born(outcome, 5)) <= 15
    back = {r.node for r in outcome.records if isinstance(r, Delivered) and r.origin == 3 and r.t_ns > 19 * S}
    assert back >= {1, 2, 4}
    summary = finish(outcome, out=None)
    assert summary["frames"]["closes"]
    assert summary["copies"]["closes"]


@pytest.mark.parametrize("offset_m", [[30, 0, 0], None])
@pytest.mark.slow
def test_a_receiver_that_is_wrong_leads_astray_and_one_that_is_silent_says_nothing(
    plain: Outcome, offset_m: list[int] | None
) -> None:
    fault = {"at_s": 12, "kind": "gps", "node": 3, "for_s": 15}
    wrong = flown({**fault, **({} if offset_m is None else {"offset_m": offset_m})})
    assert begun(wrong) == [(12.0, 3, "gps", True), (27.0, 3, "gps", False)]

    def east_m(outcome: Outcome, t_s: int) -> float:
        return next(r.east_m for r in outcome.records if isinstance(r, Posed) and r.node == 3 and r.t_ns == t_s * S)

    assert east_m(plain, 11) == east_m(wrong, 11)
    if offset_m is not None:
        assert -40 < east_m(wrong, 20) - east_m(plain, 20) < -5, "it believes that it is farther east than it is"
    else:
        assert east_m(plain, 26) != east_m(wrong, 26)


@pytest.mark.slow
def test_it_is_the_same_run_again(stopped: Outcome) -> None:
    assert list(flown(*STOPS).records) == list(stopped.records)
