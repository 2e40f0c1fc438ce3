"""Formation flight by clusters: UAVs that know of each other what hellos and floods told, and nothing else."""

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Final

from agents.mission.formation_flight.flight_place import Clusters, FlightPlace, place_on_ring
from agents.mission.formation_flight.route import Route
from agents.mission.navigation.neighbor_motions import NeighborMotions
from fanet_mw.motion import Motion
from fanet_mw.units import MS, Enu, NodeId, S

RADIUS_M: Final = 200.0
REACH_M: Final = 250.0
FLOOD_NS: Final = S
CRUISE_M_S: Final = 5.0
MOST_M_S: Final = 10.0
STEP_NS: Final = 200 * MS
EAST: Final = ((30000.0, 0.0),)


class Swarm:
    """UAVs that fly at once what their stations want; each hears hellos in reach, and floods of heads a second late."""

    def __init__(self, at: Sequence[Enu], clusters: Clusters, *, route: Sequence[tuple[float, float]] = EAST) -> None:
        self.clusters = clusters
        self.silent: set[int] = set()
        """The UAVs that neither say nor hear anything any more."""
        self.at = dict(enumerate(at, start=1))
        self._velocity = dict.fromkeys(self.at, Enu(0, 0, 0))
        self._motions = {node: NeighborMotions() for node in self.at}
        self._stations = {
            node: FlightPlace(
                NodeId(node), self._motions[node], Route(route, speed_m_s=CRUISE_M_S), radius_m=RADIUS_M,
                clusters=lambda: self.clusters,
            )
            for node in self.at
        }  # fmt: skip
        self.now_ns = 0

    def fly(self, seconds: float) -> None:
        for _ in range(round(seconds * S / STEP_NS)):
            self.now_ns += STEP_NS
            if self.now_ns % S == 0:
                self._hello()
            for node, station in self._stations.items():
                goal, feed = station.at(self.at[node], self.now_ns)
                east, north = (feed[axis] + 0.4 * (goal[axis] - self.at[node][axis]) for axis in (0, 1))
                share = min(1.0, MOST_M_S / max(1e-9, math.hypot(east, north)))
                self._velocity[node] = Enu(share * east, share * north, 0.0)
            for node, (east, north, _) in self._velocity.items():
                at, step_s = self.at[node], STEP_NS / S
                self.at[node] = Enu(at.east + step_s * east, at.north + step_s * north, at.up)

    def _hello(self) -> None:
        talking = [node for node in self.at if node not in self.silent]
        for node, other in itertools.permutations(talking, 2):
            motion = Motion(self.at[other], self._velocity[other], self.now_ns)
            if self.at[node].minus(self.at[other]).norm() <= REACH_M:
                self._motions[node].on_hello(other, motion)
            elif other in self.clusters:
                before = motion.position_at(self.now_ns - FLOOD_NS)
                self._motions[node].on_hello(other, Motion(before, motion.velocity, self.now_ns - FLOOD_NS))

    def away_m(self, node: int, others: Iterable[int]) -> list[float]:
        return [self.at[node].minus(self.at[other]).norm() for other in others]

    def gaps_deg(self, head: int, members: Iterable[int]) -> list[float]:
        """The angles between the members that fly around a head."""
        bearings = sorted(
            math.degrees(math.atan2(off.east, off.north)) for off in (self.at[m].minus(self.at[head]) for m in members)
        )
        return [(b - a) % 360 for a, b in itertools.pairwise([*bearings, bearings[0] + 360])]


def one_cluster(members: int) -> tuple[list[Enu], Clusters]:
    """A head and its members, as they stand on the ground 40 m apart."""
    places = [Enu(40.0 * (k % 4), 40.0 * (k // 4), 60.0) for k in range(members + 1)]
    return places, {NodeId(1): tuple(NodeId(node) for node in range(1, members + 2))}


def test_members_keep_their_distance_to_the_head_and_even_gaps_while_it_flies() -> None:
    swarm = Swarm(*one_cluster(6))
    swarm.fly(90)
    for _ in range(20):
        swarm.fly(3)
        assert all(abs(away - RADIUS_M) < 3 for away in swarm.away_m(1, range(2, 8)))
        assert all(abs(gap - 60) < 6 for gap in swarm.gaps_deg(1, range(2, 8)))
    assert swarm.at[1].east > 600, "the head flies its route meanwhile"


def test_where_one_is_lost_the_gap_is_closed() -> None:
    swarm = Swarm(*one_cluster(6))
    swarm.fly(90)
    swarm.silent.add(4)
    swarm.fly(3)
    left = [node for node in range(2, 8) if node != 4]
    assert max(swarm.gaps_deg(1, left)) > 110
    swarm.fly(10)
    lost_at = swarm.at[4]
    swarm.fly(50)
    assert all(abs(gap - 72) < 8 for gap in swarm.gaps_deg(1, left))
    assert swarm.at[4] == lost_at, "who hears nobody hovers"


def test_who_joins_is_let_in_and_who_leaves_gives_its_place_up() -> None:
    places, clusters = one_cluster(5)
    swarm = Swarm([*places, Enu(-900, -150, 60)], clusters)
    swarm.silent.add(7)
    swarm.fly(60)
    assert swarm.away_m(7, [1])[0] > 300, "it is in no cluster, and hears nobody"
    swarm.silent.clear()
    swarm.fly(250)
    assert abs(swarm.away_m(7, [1])[0] - RADIUS_M) < 3
    assert all(abs(gap - 60) < 6 for gap in swarm.gaps_deg(1, range(2, 8)))
    swarm.clusters = {
        NodeId(1): tuple(NodeId(node) for node in (1, 2, 3, 5, 6, 7)), NodeId(4): (NodeId(4),)
    }  # fmt: skip
    swarm.fly(90)
    assert all(abs(gap - 72) < 8 for gap in swarm.gaps_deg(1, (2, 3, 5, 6, 7)))
    assert abs(swarm.away_m(4, [1])[0] - 2.2 * RADIUS_M) < 4, "it has become the head of a cluster of its own"


def test_heads_fly_around_the_leader_so_wide_that_their_circles_do_not_touch() -> None:
    places = [Enu(150.0 * (k % 3), 150.0 * (k // 3), 60.0) for k in range(3)]
    swarm = Swarm(places, {NodeId(node): (NodeId(node),) for node in (1, 2, 3)})
    swarm.fly(120)
    assert all(abs(away - 2.2 * RADIUS_M) < 4 for away in swarm.away_m(1, (2, 3)))
    assert swarm.away_m(2, (3,))[0] > 2.2 * RADIUS_M


def test_another_head_leads_on_from_where_the_leader_was_lost() -> None:
    places = [Enu(0, 0, 60), Enu(200, 0, 60), Enu(-200, 0, 60)]
    clusters: Clusters = {NodeId(node): (NodeId(node),) for node in (1, 2, 3)}
    swarm = Swarm(places, clusters, route=((0.0, 200.0), (1500.0, 200.0)))
    swarm.fly(60)
    assert swarm.at[1].east > 10, "the leader has passed the first point"
    swarm.silent.add(1)
    swarm.clusters = {head: nodes for head, nodes in clusters.items() if head != 1}
    east_m = swarm.at[2].east
    swarm.fly(40)
    assert swarm.at[2].east > east_m + 150, "it does not fly back to a point that was passed"
    swarm.fly(80)
    assert abs(swarm.away_m(2, (3,))[0] - 2.2 * RADIUS_M) < 4


def test_a_leader_that_hears_nobody_any_more_hovers() -> None:
    swarm = Swarm(*one_cluster(2))
    swarm.fly(20)
    swarm.silent.add(1)
    swarm.fly(10)
    lost_at = swarm.at[1]
    swarm.fly(10)
    assert swarm.at[1] == lost_at


def test_a_leader_hovers_at_the_end_of_its_route_and_without_one() -> None:
    places, clusters = one_cluster(2)
    swarm = Swarm(places, clusters, route=((60.0, 0.0),))
    swarm.fly(60)
    assert swarm.at[1].minus(Enu(60, 0, 60)).norm() < 2
    still = Swarm(places, clusters, route=())
    still.fly(20)
    assert still.at[1] == places[0]


def test_a_gap_beyond_which_nobody_is_heard_counts_as_wide_but_not_as_endless() -> None:
    middle, here = Enu(0, 0, 60), Enu(0, 200, 60)
    assert place_on_ring(middle, here, [], radius_m=200, node=2).minus(here).norm() < 1e-9, "alone it stays"
    beside = Enu(200 * math.sin(0.5), 200 * math.cos(0.5), 60)
    place = place_on_ring(middle, here, [beside], radius_m=200, node=2)
    assert place.east < -20, "it turns away from the one that it hears"
    far = Enu(200 * math.sin(1.5), 200 * math.cos(1.5), 60)
    assert place_on_ring(middle, here, [far], radius_m=200, node=2).minus(here).norm() < 1e-9
    assert place_on_ring(middle, middle, [], radius_m=200, node=2).minus(middle).norm() > 199, "out of the middle"


def test_a_leader_flies_through_its_way_points_and_brakes_for_the_last() -> None:
    route = Route([(100.0, 0.0), (100.0, 200.0)], speed_m_s=8.0)
    assert route.velocity(Enu(60.0, 0.0, 50.0)) == (8.0, 0.0, 0.0)
    route.led_at(Enu(75.0, 0.0, 50.0))
    assert route.velocity(Enu(100.0, 100.0, 50.0)) == (0.0, 8.0, 0.0)
    assert route.velocity(Enu(100.0, 196.0, 50.0)) == (0.0, 1.0, 0.0)
    assert route.velocity(Enu(100.0, 200.0, 50.0)) == (0.0, 0.0, 0.0)


def test_circles_of_few_uavs_are_joined_where_they_are_nearest_to_each_other() -> None:
    places = [Enu(100.0 * (k % 4), 100.0 * (k // 4), 60.0) for k in range(12)]
    sizes = {1: (1, 4, 5, 6, 7), 2: (2, 8, 9), 3: (3, 10, 11, 12)}
    swarm = Swarm(places, {NodeId(head): tuple(NodeId(node) for node in nodes) for head, nodes in sizes.items()})
    swarm.fly(120)
    for _ in range(20):
        swarm.fly(5)
        for head in (2, 3):
            across = [away for node in sizes[head][1:] for away in swarm.away_m(node, sizes[1][1:])]
            assert min(across) < 60, "two of the circles face each other"
            assert min(away for node in sizes[head][1:] for away in swarm.away_m(node, [1])) <= REACH_M
            assert min(swarm.away_m(head, sizes[1][1:])) <= REACH_M, "if one of the two is lost, the other joins them"
            beside = [min(swarm.away_m(node, set(sizes[head][1:]) - {node})) for node in sizes[head][1:]]
            assert max(beside) <= REACH_M, "if the head is lost, its members still hear each other"
