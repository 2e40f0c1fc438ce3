"""A whole swarm of `search_board.py` in flight, of which UAVs are lost, or between whose parts no frame gets through.

Its UAVs decide as in a mission, and hear each other within reach: hellos once a second, and that somebody is silent at
once. Whom one UAV misses all of its part miss at the next step; there is no radio. Those who are lost hover, as their
flight controllers do when a program has stopped.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from search_board import COUNT, PLAN, REACH_M, SCENARIO, UP_M, Board

from agents.mission.flight.connectivity_maintenance import ConnectivityMaintenance
from agents.mission.flight.flight import Flight
from agents.mission.flight.reciprocal_avoidance import ReciprocalAvoidance
from agents.mission.flight.return_home import ReturnHome
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.search_formation.roll_call import RollCall
from fanet_mw.bus.messages import VELOCITY_LASTS_NS
from fanet_mw.motion import Motion
from fanet_mw.units import MS, US, Enu, NodeId, S
from fanet_mw.wire.search_plan import Search
from sim.results.links_over_time import parts

_STEP_NS: Final = S // 5
_SPEED_M_S: Final = 10.0
_M_S2: Final = 5.0
_SILENT_NS: Final = (1_200_000_000, 2_000_000_000, 2_800_000_000)
"""So long nobody hears a UAV until those beside it miss it, and tell their part: not of all as long."""
_KNOWN_NS: Final = 15 * S
_NEAR_M: Final = 0.96 * REACH_M
"""Missed is only who was heard so lately, and would be so near had it flown on."""
_MIDDLE: Final = COUNT * (Enu(0, 0, UP_M),)
_ACQUAINTED_NS: Final = 2 * S
"""So long before anybody is lost all fly at their places, and hear each other."""


class _Uav:
    """One UAV of the swarm."""

    def __init__(self, node: NodeId, at: Enu, plan: Search) -> None:
        self.board = board = Board(node, at, plan=plan)
        own, neighbors = board.own_motion, board.neighbors
        self.lost: dict[int, int] = {}
        self.parted: set[int] = set()
        """The others of another part, who are not lost."""
        tied = ConnectivityMaintenance(own, neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=_SPEED_M_S)
        self._obstacles = obstacles = KnownObstacles(NO_MAP)
        choice = VelocityChoice(
            own, obstacles, most_m_s=_SPEED_M_S, hard=[ReciprocalAvoidance(own, neighbors, obstacles)], soft=[tied]
        )
        home = ReturnHome(
            node, at, own, neighbors, board.out,
            speed_m_s=_SPEED_M_S, airspeed_m_s=15.0, height_m=at.up, limits=SearchLimits(SCENARIO), fixes_hz=5.0,
        )  # fmt: skip
        self._roll_call = RollCall(node, hello_interval_s=1.0)
        self._flight = Flight(
            own, board.place, board.goal, choice, tied, roll_call=self._roll_call, take_off=None, return_home=home,
            height_m=at.up, ceiling_m=120.0,
        )  # fmt: skip

    def fly(self, at: Enu, velocity: Enu, now_ns: int) -> Enu:
        self.board.place.close_ranks(self.lost, now_ns, parted=self.parted)
        self._obstacles.hovering = self.board.neighbors.hovering(self.lost, self.board.place.lost_at(now_ns))
        self._flight.fix(at, velocity, None, now_ns=now_ns)
        self.lost |= {node: now_ns for node in self._roll_call.lost if node not in self.lost}
        assert self._flight.velocity is not None
        return self._flight.velocity


class ClosingSwarm:
    """The swarm from an instant of its sweep on, when all are at their places; negative: on the way there from
    `starts`, where all stood.
    """

    def __init__(self, from_s: float, *, plan: Search = PLAN, starts: Sequence[Enu] = _MIDDLE) -> None:
        taken_up_ns = plan.start_us * US + plan.deploy_ds * 100 * MS
        self._now_ns = taken_up_ns + round(from_s * S) - _ACQUAINTED_NS
        self._uavs = [_Uav(NodeId(node), at, plan) for node, at in enumerate(starts, 1)]
        for uav, (node, at) in itertools.product(self._uavs, enumerate(starts, 1)):
            uav.board.place.see(node, at, 0)  # by its status
        places = [uav.board.place.lane(self._now_ns) for uav in self._uavs]
        self._at = np.array([at for at, _ in places], dtype=float)
        self._flown = np.array([velocity for _, velocity in places], dtype=float)
        self._lost = np.zeros(COUNT, dtype=bool)
        self._stops_ns = np.zeros(COUNT, dtype=np.int64)
        """When each of them begins to brake."""
        self._noticed_ns = np.resize(_SILENT_NS, COUNT)
        self._line: tuple[npt.NDArray[np.float64], float] | None = None
        """No frame gets across this line: its normal, and how far from the middle it is."""
        self._heard_ns = np.full((COUNT, COUNT), self._now_ns - 2 * _KNOWN_NS)
        for _ in range(_ACQUAINTED_NS // _STEP_NS):
            self.step()

    def _hears(self) -> npt.NDArray[np.bool_]:
        """Who hears whom; those who are lost hear nobody, and nobody hears them."""
        near = np.linalg.norm(self._at[:, None] - self._at[None], axis=2) <= REACH_M
        near &= ~self._lost[:, None] & ~self._lost[None]
        if self._line is not None:
            normal, off_m = self._line
            side = self._at[:, :2] @ normal > off_m
            near &= side[:, None] == side[None]
        return np.asarray(near)

    def heal_s(self, *nodes: int, within_s: float) -> float:
        """Lose UAVs at once, fly on for so long, and say when the others were apart for the last time."""
        begin_ns = end_ns = self._now_ns
        for node in nodes:
            self._lose(node)
        while self._now_ns < begin_ns + round(within_s * S):
            if len(set(parts(self._hears())[~self._lost])) > 1:
                end_ns = self._now_ns + _STEP_NS
            self.step()
        return (end_ns - begin_ns) / S

    def _lose(self, node: int) -> None:
        self._lost[node - 1], self._stops_ns[node - 1] = True, self._now_ns + VELOCITY_LASTS_NS

    def nearest_to_m(self, node: int, *, for_s: float) -> float:
        """Lose a UAV, fly on, and say how near any other one comes to it."""
        self._lose(node)
        end_ns, found = self._now_ns + for_s * S, []
        while self._now_ns < end_ns:
            apart_m = np.linalg.norm(self._at - self._at[node - 1], axis=1)
            found.append(float(np.delete(apart_m, node - 1).min()))
            self.step()
        return min(found)

    def nearest_m(self, *, along: float, off_m: float, for_s: float) -> float:
        """Part the air along a line whose normal has this angle, and say how near any two UAVs come to each other."""
        self._line, end_ns, found = (np.array([math.cos(along), math.sin(along)]), off_m), self._now_ns + for_s * S, []
        while self._now_ns < end_ns:
            apart_m = np.linalg.norm(self._at[:, None] - self._at[None], axis=2)
            found.append(float(apart_m[~np.eye(COUNT, dtype=bool)].min()))
            self.step()
        self._line = None
        return min(found)

    def step(self) -> None:
        self._hear()
        wanted = self._flown.copy()
        wanted[self._lost & (self._now_ns >= self._stops_ns)] = 0.0
        for index in np.flatnonzero(~self._lost):
            uav = self._uavs[index]
            wanted[index] = uav.fly(Enu(*self._at[index]), Enu(*self._flown[index]), self._now_ns)
        change = wanted - self._flown
        size = np.linalg.norm(change, axis=1, keepdims=True)
        after = self._flown + change * np.minimum(1.0, _M_S2 * _STEP_NS / S / np.maximum(size, 1e-9))
        self._at += (self._flown + after) / 2 * (_STEP_NS / S)
        self._flown = after
        self._now_ns += _STEP_NS

    def _hear(self) -> None:
        """Hellos, each UAV's at an instant of its own within a second, and whom each UAV misses."""
        hears, now_ns = self._hears(), self._now_ns
        self._heard_ns[hears] = now_ns
        for index, uav in enumerate(self._uavs):
            if (now_ns // _STEP_NS + index * 3) % 5 == 0:
                motion = Motion(Enu(*self._at[index]), Enu(*self._flown[index]), now_ns)
                for other in np.flatnonzero(hears[index]):
                    if other != index:
                        self._uavs[other].board.neighbors.on_hello(index + 1, motion)
                        self._uavs[other].board.place.see(index + 1, motion.position, now_ns)
            silent_ns = now_ns - self._heard_ns[index]
            for other in np.flatnonzero((silent_ns >= self._noticed_ns) & (silent_ns < _KNOWN_NS)):
                known = uav.board.neighbors.motion(other + 1, now_ns=now_ns)
                if known is not None and known.offset_from(uav.board.own_motion.position, now_ns).norm() <= _NEAR_M:
                    uav.lost.setdefault(int(other) + 1, now_ns)
        part = parts(hears)
        for one in set(part[~self._lost].tolist()):
            members = np.flatnonzero((part == one) & ~self._lost)
            here = {int(member) + 1 for member in members}
            missed = set[int]().union(*(self._uavs[member].lost for member in members)) - here
            for member in members:
                lost = self._uavs[member].lost
                for back in lost.keys() - missed:
                    del lost[back]
                lost |= {node: now_ns for node in missed if node not in lost}
                self._uavs[member].parted = set(range(1, COUNT + 1)) - here - missed
