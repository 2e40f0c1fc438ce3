"""A whole swarm of `search_board.py` in flight, of which UAVs are lost: its UAVs decide as in a mission, and hear each
other within reach once a second. What they know of losses comes by itself, as soon as in a mission; there is no radio.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from search_board import COUNT, OPEN, REACH_M, SCENARIO, TAKEN_UP_NS, Board

from agents.mission.flight.connectivity_maintenance import ConnectivityMaintenance
from agents.mission.flight.flight import Flight
from agents.mission.flight.reciprocal_avoidance import ReciprocalAvoidance
from agents.mission.flight.return_home import ReturnHome
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.flight.velocity_choice import VelocityChoice
from agents.mission.search_formation.roll_call import RollCall
from fanet_mw.motion import Motion
from fanet_mw.units import Enu, NodeId, S
from sim.results.connectivity import parts

_STEP_NS: Final = S // 5
_SPEED_M_S: Final = 10.0
_M_S2: Final = 5.0
_NOTICED_NS: Final = 900_000_000
"""Those beside a UAV know so long after its loss that it is lost."""
_TOLD_NS: Final = 500_000_000
"""So long after that all of their part know it."""


_ACQUAINTED_NS: Final = 2 * S
"""So long before anybody is lost all fly at their places, and hear each other."""


class _Uav:
    """One UAV of the swarm."""

    def __init__(self, node: NodeId, at: Enu) -> None:
        self.board = board = Board(node, at)
        own, neighbors = board.own_motion, board.neighbors
        self.lost: set[int] = set()
        tied = ConnectivityMaintenance(own, neighbors, board.place, board.tasks, reach_m=REACH_M, speed_m_s=_SPEED_M_S)
        choice = VelocityChoice(
            own, OPEN, most_m_s=_SPEED_M_S, hard=[ReciprocalAvoidance(own, neighbors, OPEN)], soft=[tied]
        )
        home = ReturnHome(
            node, at, own, neighbors, board.out,
            speed_m_s=_SPEED_M_S, airspeed_m_s=15.0, height_m=at.up, limits=SearchLimits(SCENARIO),
        )  # fmt: skip
        self._flight = Flight(
            own, board.place, board.goal, choice, tied,
            roll_call=RollCall(node, hello_interval_s=1.0), take_off=None, return_home=home,
        )  # fmt: skip

    def fly(self, at: Enu, velocity: Enu, now_ns: int) -> Enu:
        self.board.place.close_ranks(self.lost, now_ns)
        self._flight.fix(at, velocity, None, now_ns=now_ns)
        assert self._flight.velocity is not None
        return self._flight.velocity


class ClosingSwarm:
    """The swarm from an instant of its sweep on, when all are at their places."""

    def __init__(self, from_s: float) -> None:
        self._now_ns = TAKEN_UP_NS + round(from_s * S) - _ACQUAINTED_NS
        places = [Board(NodeId(node), Enu(0, 0, 0)).place.lane(self._now_ns) for node in range(1, COUNT + 1)]
        self._at = np.array([at for at, _ in places], dtype=float)
        self._flown = np.array([velocity for _, velocity in places], dtype=float)
        self._uavs = [_Uav(NodeId(node), at) for node, (at, _) in enumerate(places, 1)]
        self._lost_ns: dict[int, int] = {}
        for _ in range(_ACQUAINTED_NS // _STEP_NS):
            self.step()

    @property
    def _lives(self) -> npt.NDArray[np.bool_]:
        return ~np.isin(np.arange(1, COUNT + 1), list(self._lost_ns))

    def _parts(self) -> npt.NDArray[np.int64]:
        """The part of each UAV; those who are lost are a part each."""
        near = np.linalg.norm(self._at[:, None] - self._at[None], axis=2) <= REACH_M
        return np.asarray(parts(near & self._lives[:, None] & self._lives[None]))

    def heal_s(self, node: int, *, within_s: float) -> float:
        """Lose a UAV, fly on for so long, and say when the others were apart for the last time."""
        begin_ns = end_ns = self._now_ns
        self._lost_ns[node] = begin_ns
        while self._now_ns < begin_ns + round(within_s * S):
            if len(set(self._parts()[self._lives])) > 1:
                end_ns = self._now_ns + _STEP_NS
            self.step()
        return (end_ns - begin_ns) / S

    def step(self) -> None:
        part = self._parts()
        self._hear(part)
        wanted = self._flown.copy()
        for index in np.flatnonzero(self._lives):
            uav = self._uavs[index]
            wanted[index] = uav.fly(Enu(*self._at[index]), Enu(*self._flown[index]), self._now_ns)
        change = wanted - self._flown
        size = np.linalg.norm(change, axis=1, keepdims=True)
        after = self._flown + change * np.minimum(1.0, _M_S2 * _STEP_NS / S / np.maximum(size, 1e-9))
        self._at += (self._flown + after) / 2 * (_STEP_NS / S)
        self._flown = after
        self._now_ns += _STEP_NS

    def _hear(self, part: Sequence[int] | npt.NDArray[np.int64]) -> None:
        """Hellos, each UAV's at an instant of its own within a second, and news of losses."""
        for index in np.flatnonzero(self._lives):
            if (self._now_ns // _STEP_NS + index * 3) % 5 == 0:
                motion = Motion(Enu(*self._at[index]), Enu(*self._flown[index]), self._now_ns)
                apart_m = np.linalg.norm(self._at - self._at[index], axis=1)
                for other in np.flatnonzero(self._lives & (apart_m <= REACH_M)):
                    if other != index:
                        self._uavs[other].board.neighbors.on_hello(index + 1, motion)
        for node, lost_ns in self._lost_ns.items():
            if self._now_ns >= lost_ns + _NOTICED_NS + _TOLD_NS:
                told = {part[index] for index in np.flatnonzero(self._lives) if node in self._uavs[index].lost}
                for index in np.flatnonzero(self._lives):
                    if part[index] in told:
                        self._uavs[index].lost.add(node)
            elif self._now_ns >= lost_ns + _NOTICED_NS:
                for index in np.flatnonzero(self._lives):
                    uav = self._uavs[index]
                    if uav.board.neighbors.motion(node, now_ns=self._now_ns) is not None:
                        uav.lost.add(node)
