"""UAVs whose pads are beside each other land in turns."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from kit import MakeScenario

from agents.mission.flight.return_home import ReturnHome
from agents.mission.flight.search_limits import SearchLimits
from agents.mission.navigation.known_obstacles import KnownObstacles
from agents.mission.navigation.neighbor_motions import NeighborMotions
from agents.mission.navigation.onboard_map import NO_MAP
from agents.mission.navigation.own_motion import OwnMotion
from agents.mission.outbox import Outbox
from fanet_mw.motion import Motion
from fanet_mw.units import MS, STILL, Enu, NodeId, S

TICK_NS: Final = 200 * MS
HOMEWARD_M_S, SINK_M_S = 8.0, 1.5


class Homecoming:
    """UAVs that fly straight to the goals of their returns, and hear each other."""

    def __init__(self, make_scenario: MakeScenario, *, pads: Sequence[Enu], starts: Sequence[Enu]) -> None:
        limits = SearchLimits(make_scenario())
        self.pads, self.at = pads, list(starts)
        self.own = [OwnMotion(start, KnownObstacles(NO_MAP)) for start in starts]
        self.heard = [NeighborMotions() for _ in pads]
        nodes = range(1, len(pads) + 1)
        self.returns = [
            ReturnHome(
                NodeId(node), pad, own, heard, Outbox(), speed_m_s=10.0, airspeed_m_s=19.0,
                height_m=65.0, limits=limits, beside={*nodes} - {node},
            )
            for node, pad, own, heard in zip(nodes, pads, self.own, self.heard, strict=True)
        ]  # fmt: skip
        self.flown = [STILL for _ in pads]
        self.landed_s: dict[int, float] = {}
        self.nearest_m = float("inf")
        """The least distance of two that are over the pads and on one level; elsewhere they avoid each other."""
        self.now_ns = 0

    def fly(self, seconds: float) -> None:
        until_ns = self.now_ns + round(seconds * S)
        while self.now_ns < until_ns:
            for row, here in enumerate(self.at):
                for other, heard in enumerate(self.heard):
                    if other != row:
                        heard.on_hello(row + 1, Motion(here, self.flown[row], self.now_ns))
            before, self.at = self.at, [self._moved(row, here) for row, here in enumerate(self.at)]
            moves = [at.minus(was) for at, was in zip(self.at, before, strict=True)]
            self.flown = [Enu(*(S / TICK_NS * part for part in move)) for move in moves]
            for row, one in enumerate(self.at):
                for other in self.at[:row]:
                    over = max(at.minus(self.pads[0]).horizontal() for at in (one, other))
                    if over < 20.0 and min(one.up, other.up) > 1.0 and abs(one.up - other.up) < 5.0:
                        self.nearest_m = min(self.nearest_m, one.minus(other).horizontal())
            self.now_ns += TICK_NS

    def _moved(self, row: int, here: Enu) -> Enu:
        own, back = self.own[row], self.returns[row]
        step_s = TICK_NS / S
        own.fix(here, self.flown[row], now_ns=self.now_ns)
        if back.land_if_there(self.now_ns):
            self.landed_s.setdefault(row + 1, self.now_ns / S)
            return here._replace(up=max(0.0, here.up - SINK_M_S * step_s))
        off = back.goal(self.now_ns).minus(here)
        share = min(1.0, HOMEWARD_M_S * step_s / max(1e-9, off.horizontal()))
        return Enu(here.east + share * off.east, here.north + share * off.north, here.up)


def test_of_those_whose_pads_are_beside_each_other_one_sinks_at_a_time_and_nobody_waits_for_ever(
    make_scenario: MakeScenario,
) -> None:
    pads = [Enu(3.0 * (row % 3), 3.0 * (row // 3), 0.0) for row in range(6)]
    starts = [Enu(200.0 + 15.0 * row, -60.0 + 25.0 * row, 83.0) for row in range(6)]
    swarm = Homecoming(make_scenario, pads=pads, starts=starts)
    swarm.fly(180)
    assert sorted(swarm.landed_s) == [1, 2, 3, 4, 5, 6]
    instants = sorted(swarm.landed_s.values())
    assert min(late - early for early, late in pairwise(instants)) >= 5.0
    assert instants[-1] - instants[0] <= 5 * 14.0
    assert swarm.nearest_m > 8.0
    assert all(at.minus(pad).horizontal() <= 1.6 and at.up == 0.0 for at, pad in zip(swarm.at, pads, strict=True))


def test_who_hears_nobody_beside_its_pad_lands_at_once(make_scenario: MakeScenario) -> None:
    swarm = Homecoming(make_scenario, pads=[Enu(0, 0, 0)], starts=[Enu(80, 0, 83)])
    swarm.fly(15)
    assert swarm.landed_s[1] < 12.0
