"""Where the leader believes its nodes to be: on straight flight, or with it through a turn before updates have come."""

import pytest

from fanet_mw.motion import Motion
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.roster import Roster
from fanet_mw.units import Enu, NodeId, S

EAST, NORTH = Enu(10.0, 0.0, 0.0), Enu(0.0, 10.0, 0.0)
TURN_S, SETTLED_S = 20, 14
NODE = NodeId(2)


class Formation:
    """A leader that flies east and turns north at 20 s, and a node 200 m west of it that joined at 5 s."""

    def __init__(self, velocity: Enu = EAST, *, rigid: bool = False) -> None:
        self.roster = Roster(
            Liveness(), lost_ns=60 * S, objection_ns=0, sure_m=None, settled_ns=SETTLED_S * S, rigid=rigid
        )
        self.now_s = 0
        self.fly(until_s=5)
        self.roster.on_join(NODE, Motion(Enu(-150.0, 0.0, 50.0), velocity, 5 * S))

    def here(self) -> Motion:
        if self.now_s <= TURN_S:
            return Motion(Enu(10.0 * self.now_s, 0.0, 50.0), EAST, self.now_s * S)
        return Motion(Enu(10.0 * TURN_S, 10.0 * (self.now_s - TURN_S), 50.0), NORTH, self.now_s * S)

    def fly(self, until_s: int) -> None:
        for now_s in range(self.now_s, until_s + 1):
            self.now_s = now_s
            self.roster.own.add(self.here())

    def offset(self) -> Enu:
        """The node's place relative to the leader's, three seconds ahead."""
        t_ns = (self.now_s + 3) * S
        return self.roster.places(t_ns, now_ns=self.now_s * S)[NODE].minus(self.here().position_at(t_ns))


def beside(offset: Enu, east_m: float, north_m: float) -> bool:
    return abs(offset.east - east_m) < 1 and abs(offset.north - north_m) < 1


@pytest.mark.parametrize("until_s", [6, 12, TURN_S])
def test_while_both_fly_straight_the_node_keeps_its_place(until_s: int) -> None:
    formation = Formation()
    formation.fly(until_s)
    assert beside(formation.offset(), -200, 0)
    assert not formation.roster.is_turning(formation.now_s * S)


@pytest.mark.parametrize("since_s", [1, 5, SETTLED_S - 1])
def test_a_formation_that_turns_keeps_its_shape_before_its_updates_have_come(since_s: int) -> None:
    formation = Formation()
    formation.fly(TURN_S + since_s)
    assert beside(formation.offset(), -200, 0)
    assert formation.roster.is_turning(formation.now_s * S), "but who has turned along is not known yet"


def test_a_node_that_has_sent_no_update_long_after_the_turn_has_flown_on() -> None:
    formation = Formation()
    formation.fly(TURN_S + SETTLED_S + 2)
    straight = Motion(Enu(-150.0, 0.0, 50.0), EAST, 5 * S)
    place = formation.roster.places(formation.now_s * S, now_ns=formation.now_s * S)[NODE]
    assert place == straight.position_at(formation.now_s * S)
    assert not formation.roster.is_turning(formation.now_s * S)


def test_a_node_on_a_way_of_its_own_does_not_turn_with_the_leader() -> None:
    formation = Formation(velocity=Enu(-5.0, 3.0, 0.0))
    formation.fly(TURN_S + 5)
    straight = Motion(Enu(-150.0, 0.0, 50.0), Enu(-5.0, 3.0, 0.0), 5 * S)
    assert formation.roster.places(30 * S, now_ns=25 * S)[NODE] == straight.position_at(30 * S)
    assert not formation.roster.is_turning(25 * S)


@pytest.mark.parametrize("until_s", [6, TURN_S, TURN_S + SETTLED_S - 1])
def test_in_a_rigid_formation_an_error_of_a_velocity_moves_nobody(until_s: int) -> None:
    """When a formation sets out, fixes of the same second show speeds that differ by a metre a second."""
    formation = Formation(velocity=Enu(8.6, 0.3, 0.0), rigid=True)
    formation.fly(until_s)
    assert beside(formation.offset(), -200, 0)


@pytest.mark.parametrize("until_s", [6, TURN_S, TURN_S + SETTLED_S + 5])
def test_in_a_rigid_formation_a_node_that_joined_before_its_first_velocity_stays_beside_the_leader(
    until_s: int,
) -> None:
    formation = Formation(velocity=Enu(0.0, 0.0, 0.0), rigid=True)
    formation.fly(until_s)
    assert beside(formation.offset(), -200, 0)
