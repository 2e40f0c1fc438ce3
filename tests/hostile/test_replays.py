"""A foreign station repeats, byte for byte and later, what it heard: nobody's clock follows it, and nearly all arrives.

`replays.py` is the long run: more scenarios, seeds, places and delays.
"""

import pytest
import replays
from kit import slow
from replays import Attack

from fanet_mw.units import US
from fanet_mw.wire import Kind


def attack(kind: Kind, delay_s: float, *, spoofed: bool, seed: int = 1, place: str = "middle") -> Attack:
    return Attack("clusters", seed, place, kind, spoofed, delay_s)


@pytest.mark.parametrize(
    ("attack", "refused"),
    [
        (attack(Kind.HELLO, 0.2, spoofed=True), "old"),
        *slow(
            (attack(Kind.HELLO, 0.2, spoofed=False), "relayed"),
            (attack(Kind.HELLO, 0.2, spoofed=True, seed=2), "old"),
            (attack(Kind.HELLO, 3.0, spoofed=False), "relayed"),
            (attack(Kind.HELLO, 3.0, spoofed=True), "old"),
            (attack(Kind.JOIN, 1.0, spoofed=True), "duplicate"),
            (attack(Kind.SCHEDULE, 2.0, spoofed=True, place="corner"), "duplicate"),
        ),
    ],
    ids=str,
)
def test_clocks_and_deliveries_are_those_without_the_station(attack: Attack, refused: str) -> None:
    seen = replays.run(attack, "duration_s=34")
    assert seen.sent > 20
    assert seen.apart_ns < 100 * US
    assert seen.beyond == 0
    assert seen.summary["pdr"] >= replays.LEAST_SHARE
    assert seen.refused()[refused] > 50


@pytest.mark.parametrize(
    "attack",
    [attack(Kind.DATA, 1.0, spoofed=True, place="corner"), *slow((attack(Kind.DATA, 1.0, spoofed=False),))],
    ids=str,
)
def test_data_that_fall_into_turns_of_others_cost_no_packets(attack: Attack) -> None:
    seen = replays.run(attack, "duration_s=40", "drain_s=4")
    assert seen.sent > 100
    assert seen.apart_ns < 100 * US
    assert seen.summary["pdr"] >= replays.LEAST_SHARE
    bound = seen.summary["bound"]
    assert bound["violations"] > 0
    assert not seen.summary["valid"], "what came after its bound is a broken promise all the same"


@pytest.mark.slow
def test_without_resuming_the_same_station_takes_a_third() -> None:
    seen = replays.run(attack(Kind.DATA, 1.0, spoofed=False), "duration_s=40", "drain_s=4", "clusters.resume=false")
    assert seen.summary["pdr"] < 0.8


@pytest.mark.parametrize(
    "attack", [attack(Kind.DATA, 1.0, spoofed=False), attack(Kind.DATA, 1.0, spoofed=True)], ids=str
)
@pytest.mark.slow
def test_in_rounds_they_cost_time_only(attack: Attack) -> None:
    """With `rounds.repeats=0` the first run loses 1.4 % of the packets."""
    seen = replays.run(attack, "routing.protocol=rounds", "duration_s=38", "drain_s=4")
    assert seen.sent > 200
    assert seen.apart_ns < 100 * US
    assert seen.summary["pdr"] >= replays.LEAST_SHARE


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("attack", [one for one in replays.matrix() if one.scenario == "clusters"][::7], ids=str)
def test_no_repeated_frame_takes_more_than_a_hundredth_of_the_packets(attack: Attack) -> None:
    verdict = replays.judged(attack)
    assert verdict.kept, str(verdict)


def test_the_matrix_has_every_kind_at_both_places_under_both_addresses_with_five_seeds_and_all_delays() -> None:
    runs = replays.matrix()
    assert len(set(runs)) == len(runs) == 200
    for scenario, kinds in replays.KINDS.items():
        for kind in kinds:
            of = [one for one in runs if (one.scenario, one.kind) == (scenario, kind)]
            assert {(one.seed, one.place, one.spoofed) for one in of} == {
                (seed, place, spoofed)
                for seed in replays.SEEDS
                for place in ("corner", "middle")
                for spoofed in (False, True)
            }
            assert {one.delay_s for one in of} == set(replays.DELAYS_S)
