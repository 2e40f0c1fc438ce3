"""Likely delays in rounds: what packets of others took, over their hops, shows what the own ones will take."""

from fanet_mw.routing.rounds.delay_law import LikelyDelay

WAY_NS = 100


def test_nothing_is_likely_before_enough_was_heard() -> None:
    likely = LikelyDelay()
    for _ in range(299):
        likely.hear(50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) is None
    likely.hear(50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) == 62


def test_a_few_late_packets_are_covered_and_scaled_to_the_own_way() -> None:
    likely = LikelyDelay()
    for number in range(600):
        likely.hear(300 if number % 100 == 0 else 50, way_ns=WAY_NS)
    assert likely.over_ns(10 * WAY_NS) == 3125, "one in a hundred is more than the share that may be missing"


def test_what_is_late_beyond_measure_leaves_nothing_to_state() -> None:
    likely = LikelyDelay()
    for number in range(600):
        likely.hear(100 * WAY_NS if number % 100 == 0 else 50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) is None


def test_what_is_long_ago_is_forgotten() -> None:
    likely = LikelyDelay()
    for _ in range(400):
        likely.hear(300, way_ns=WAY_NS)
    for _ in range(8000):
        likely.hear(50, way_ns=WAY_NS)
    assert likely.over_ns(WAY_NS) == 62
