"""How near bodies come to each other, between two steps too."""

import numpy as np

from sim.world.incidents import Separation


def rows(*places: tuple[float, float]) -> np.ndarray:
    return np.array([(east, north, 50.0) for east, north in places])


def test_two_that_pass_each_other_between_two_steps_are_seen() -> None:
    seen = Separation(10.0)
    seen.watch(rows((0, 0), (100, 3)), rows((100, 0), (0, 3)))
    assert seen.report() == {"least_m": 3.0, "losses": 1}


def test_the_least_distance_is_that_of_the_whole_run() -> None:
    seen = Separation(10.0)
    near, far = rows((0, 0), (20, 0)), rows((0, 0), (90, 0))
    seen.watch(near, far)
    seen.watch(far, far)
    assert seen.report() == {"least_m": 20.0, "losses": 0}


def test_a_pair_that_stays_near_counts_once_and_again_when_it_has_been_apart() -> None:
    seen = Separation(10.0)
    near, far = rows((0, 0), (5, 0)), rows((0, 0), (50, 0))
    for before, after in ((near, near), (near, near), (far, far), (near, near)):
        seen.watch(before, after)
    assert seen.report()["losses"] == 2


def test_nothing_is_said_while_nothing_has_moved() -> None:
    assert Separation(10.0).report() == {"least_m": None, "losses": 0}
