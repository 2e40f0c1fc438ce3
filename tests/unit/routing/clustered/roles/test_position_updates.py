"""When a node sends a position update: range 250 m, so 25 m off; at least 5 s apart; after 20 s at the latest."""

import pytest

from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.roles.position_updates import PositionUpdates
from fanet_mw.units import Enu, S

HERE, STILL = Enu(0.0, 0.0, 50.0), Enu(0.0, 0.0, 0.0)


def told(velocity: Enu = STILL) -> PositionUpdates:
    found = PositionUpdates(range_m=250.0)
    found.on_update(Motion(HERE, velocity, 0))
    return found


def test_who_flies_on_straight_as_it_told_need_not_tell() -> None:
    known = told(Enu(10.0, 0.0, 0.0))
    assert not known.outdated(Enu(100.0, 0.0, 50.0), now_ns=10 * S)
    assert known.outdated(HERE, now_ns=10 * S), "who has stopped must"


@pytest.mark.parametrize(("east_m", "tells"), [(24.9, False), (25.1, True)])
def test_who_is_a_tenth_of_the_range_off_tells(east_m: float, tells: bool) -> None:
    assert told().outdated(Enu(east_m, 0.0, 50.0), now_ns=10 * S) == tells


def test_two_tellings_are_some_seconds_apart() -> None:
    known = told()
    assert not known.outdated(Enu(1000.0, 0.0, 50.0), now_ns=5 * S - 1)
    assert not known.may_update(5 * S - 1)
    assert known.outdated(Enu(1000.0, 0.0, 50.0), now_ns=5 * S)


def test_who_has_flooded_nothing_for_long_tells_that_it_lives() -> None:
    known = told()
    assert not known.outdated(HERE, now_ns=20 * S)
    assert known.outdated(HERE, now_ns=20 * S + 1)
    known.on_flooding(15 * S)
    assert not known.outdated(HERE, now_ns=35 * S)


def test_who_has_never_told_does_not_begin_here() -> None:
    assert not PositionUpdates(range_m=250.0).outdated(HERE, now_ns=100 * S)
