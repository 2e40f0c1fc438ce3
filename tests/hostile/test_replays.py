"""A foreign station repeats, byte for byte and later, what it heard: nobody's clock follows it, and nearly all arrives.

`replays.py` is the long run: more scenarios, seeds, places and delays.
"""

import pytest
import replays
from replays import Attack

from fanet_mw.units import US
from fanet_mw.wire import Kind


def attack(kind: Kind, delay_s: float, *, spoofed: bool, seed: int = 1, place: str = "middle") -> Attack:
    return Attack("clusters", seed, place, kind, spoofed, delay_s)


@pytest.mark.parametrize(
    ("attack", "refused"),
    [
        (attack(Kind.HELLO, 0.2, spoofed=False), "relayed"),
        (attack(Kind.HELLO, 0.2, spoofed=True), "old"),
        (attack(Kind.HELLO, 0.2, spoofed=True, seed=2), "old"),
        (attack(Kind.HELLO, 3.0, spoofed=False), "relayed"),
        (attack(Kind.HELLO, 3.0, spoofed=True), "old"),
        (attack(Kind.SCHEDULE, 2.0, spoofed=True, place="corner"), "duplicate"),
        (attack(Kind.JOIN, 1.0, spoofed=True), "duplicate"),
    ],
    ids=str,
)
def test_clocks_and_deliveries_are_those_without_the_station(attack: Attack, refused: str) -> None:
    seen = replays.run(attack, "duration_s=34")
    assert seen.sent > 20
    assert seen.apart_ns < 100 * US
    assert seen.beyond == 0
    assert seen.summary["pdr"] >= replays.LEAST_SHARE
    bound = seen.summary["bound"]
    assert bound.get("violations", 0) == bound.get("never", 0), "nothing comes later than its bound"
    assert seen.refused()[refused] > 50


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_no_repeated_frame_does_more_than_nonsense_of_its_length(seed: int) -> None:
    attack = replays.drawn(seed)
    line, kept = replays.judged(attack, replays.run(attack), replays.silent(attack), replays.run(attack, nonsense=True))
    assert kept, line
