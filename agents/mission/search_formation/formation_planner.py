"""Plans the search: one node decides which UAV takes which place of the formation, and floods the plan.

The planner is the node with the lowest id that was received recently; each part of a swarm that has come apart has its
own. Lost UAVs keep their places: the others close ranks by themselves (`roll_call.py`). A UAV that flies home is
replaced at once; once those that stay cannot span the area any more, they get a plan for another formation
(docs/explanation/search.md, Who decides what).
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Final, NamedTuple

from agents.mission.search_formation.lasting_links import keep_together
from agents.mission.search_formation.pattern import Pattern
from agents.mission.search_formation.roll_call import RollCall
from agents.mission.search_formation.shapes.contract import Dimensions, ShapeName, swarm_at
from fanet_mw.serial_number import following, newer
from fanet_mw.units import US, Enu, NodeId, S
from fanet_mw.wire.search_plan import MOST_PLACED, Search, SearchStatus

STATUS_S: Final = 12.0
"""The interval at which a UAV of a swarm of up to `_MANY` sends its status."""
_MANY: Final = 60
"""All turns carry what all say: of more UAVs each sends its status less often, and a flood takes longer."""
_SELDOM: Final = 3.0
"""The greatest such factor: who says nothing for `_LOST_NS` is taken to have gone."""
_LOST_NS: Final = 70 * S
"""A UAV from which nothing was received for this time does not plan any more, and if it is lost has no right to its
place.
"""
_SETTLED_NS: Final = 10 * S
"""How long a plan is followed, at least, before it is mended."""
_PATIENCE_NS: Final = 14 * S
"""How long the first plan waits for UAVs that have not been received."""
NOTICE_NS: Final = 7 * S
"""From the first flood of a plan to its beginning: enough for a flood through the slots of all clusters."""
NOTICE_IN_ROUNDS_NS: Final = 3 * S
"""The same where floods go in rounds, and reach all within about a second."""
_REMINDS_NS: Final = 1 * S
"""A plan is flooded again so long before it begins, for UAVs that the first flood did not reach."""
_REPEAT_NS: Final = 6 * S
"""The interval at which a new plan is flooded again."""
_REPEATS: Final = 3
"""The number of times that a new plan is flooded again."""
_BEHIND_NS: Final = 15 * S
"""A node whose status names an older plan this long after this node began to follow its own cannot be the planner."""
_ASKS_NS: Final = 60 * S
"""How long a node without a plan waits to be told that of the others before it makes one that replaces theirs."""
_BUSY_M2: Final = 500.0**2
"""The cost of a place other than a follower's for a UAV that is out for a survivor, beside the square of its way."""
_AMONG_M_S: Final = 3.7
"""A formation that begins around the swarm does so no sooner than a UAV could fly at this speed as far as neighbors are
apart: survivors among the UAVs are found meanwhile, because nobody passes there for long after."""
_LEAVE_NS: Final = 6 * S
"""When this time has passed since a UAV left, all that leave together, as at the end of a search, have said so."""
_REVISION_BITS: Final = 16


def size_factor(uavs: int) -> float:
    """By how much more rarely a UAV of so many sends its status, and longer a flood takes, than in a small swarm."""
    return min(_SELDOM, max(1.0, uavs / _MANY))


class _HeardUav(NamedTuple):
    """What a node knows of another UAV, or of itself, for a plan."""

    position: Enu
    heard_ns: int
    """The instant at which the node was there, and said so."""
    revision: int
    """The plan that the node follows, by its latest status; 0 if it has none."""
    leaves: bool
    """True for a node that flies home: it has no place any more, and does not plan any more."""
    absent: bool = False
    """True while the node is out of its place for a survivor, by its latest status."""
    stated_ns: int | None = None
    """The instant of the latest status; None for a node of which only hellos were received."""


class FormationPlanner:
    """The planning at one node. Any node can be the planner; all others only listen."""

    def __init__(
        self,
        node: NodeId,
        roll_call: RollCall,
        *,
        expected: int,
        deploy_speed_m_s: float,
        of_few: Callable[[int, int], Pattern | None],
        notice_ns: int = NOTICE_NS,
        take_off_ns: int = 0,
        turns_ns: Callable[[Mapping[int, Enu]], int] = lambda _: 0,
        random: Callable[[], float],
    ) -> None:
        """`of_few`: the formation for so many UAVs when others have flown home; None: the search is over.
        `notice_ns`: from the first flood of a plan to its beginning; `take_off_ns`: the time of a take-off, before
        which no first plan begins; `turns_ns`: how much longer the take-off of these UAVs takes if they take turns.
        """
        self._node = node
        self._roll_call = roll_call
        self._notice_ns = notice_ns
        self._take_off_ns, self._turns_ns, self._of_few = take_off_ns, turns_ns, of_few
        self._expected = expected
        self._deploy_speed = deploy_speed_m_s
        self._random = random
        self._members: dict[int, _HeardUav] = {}
        """All UAVs that were received, and this one, by id."""
        self._left_ns: dict[int, int] = {}
        """The instant at which each UAV that flies home was first known to do so."""
        self._began_ns: int | None = None
        """The instant of the first review."""
        self.plan: Search | None = None
        """The plan in force; None before the first."""
        self.to_tell: list[Search] = []
        """The plans to be flooded, until the caller takes them."""
        self._told_ns: int | None = None
        """The instant at which this node flooded a plan last."""
        self._tellings_left = 0
        """The number of times that it still floods its own plan."""
        self._followed: Search | None = None
        """The plan at the last review."""
        self._followed_ns = 0
        """The instant of the first review with this plan."""

    # --- input ----------------------------------------------------------------------------------------------------

    def status(self, status: SearchStatus, *, now_ns: int) -> None:
        before = self._members.get(status.node)
        stated_ns = min(now_ns, status.t_us * US)
        if before is not None and before.stated_ns is not None and stated_ns < before.stated_ns:
            return
        position, heard_ns = status.position, stated_ns
        if before is not None and before.heard_ns > stated_ns:  # a flood takes longer than a hello
            position, heard_ns = before.position, before.heard_ns
        leaves = status.charge == 0
        if leaves:
            self._left_ns.setdefault(status.node, now_ns)
        else:
            self._left_ns.pop(status.node, None)
        self._members[status.node] = _HeardUav(
            position, heard_ns, status.revision, leaves=leaves, absent=status.absent, stated_ns=stated_ns
        )

    def on_neighbor(self, node: int, position: Enu, *, now_ns: int) -> None:
        before = self._members.get(node)
        self._members[node] = (
            before._replace(position=position, heard_ns=now_ns)
            if before
            else _HeardUav(position, now_ns, revision=0, leaves=False)
        )

    def on_plan(self, plan: Search) -> bool:
        mine = self.plan
        if mine is not None and not _replaces(plan, mine):
            return False
        self.plan = plan
        return True

    # --- decisions ------------------------------------------------------------------------------------------------

    def review(self, pattern: Pattern | None, *, now_ns: int) -> bool:
        """Make a plan, mend it, or flood it again, about once a second; True if there is a new one."""
        if self._began_ns is None:
            self._began_ns = now_ns
        if self._followed is not self.plan:
            self._followed, self._followed_ns = self.plan, now_ns
        if self._leads(now_ns):
            if self.plan is None:
                if pattern is not None and self._may_plan(now_ns - self._began_ns):
                    self._adopt(self._first(pattern, now_ns), now_ns)
                    return True
            elif now_ns > self.plan.start_us * US and now_ns - self._followed_ns > _SETTLED_NS:
                mended = self._mended(self.plan, now_ns)
                if mended is not None:
                    self._adopt(mended, now_ns)
                    return True
            self._tell_again(now_ns)
        return False

    def _leads(self, now_ns: int) -> bool:
        """True for the planner: no node with a lower id was received recently that stays and knows the plan."""
        me = self._members.get(self._node)
        return not (me is not None and me.leaves) and all(
            node >= self._node
            or member.leaves
            or node in self._roll_call.lost
            or node in self._roll_call.parted
            or now_ns - member.heard_ns > _LOST_NS
            or self._lacks_plan(member)
            for node, member in self._members.items()
        )

    def _may_plan(self, waited_ns: int) -> bool:
        """True if a first plan may be made: all UAVs are known, or were waited for long enough. While others follow a
        plan, as after a restart of this node, it is waited for.
        """
        members = self._members.values()
        if waited_ns < _ASKS_NS and any(member.revision for member in members):
            return False
        stated = sum(member.stated_ns is not None for member in members)
        everyone = len(members) >= self._expected and stated >= min(2, self._expected)
        return everyone or waited_ns >= _PATIENCE_NS

    def _lacks_plan(self, member: _HeardUav) -> bool:
        """True for a node that has said that it does not follow the plan, long after it could have been told."""
        return self._is_behind(member, after_ns=_BEHIND_NS)

    def _is_behind(self, member: _HeardUav, *, after_ns: int) -> bool:
        """True for a node whose status names no plan, or an older one than that of this node, and was said `after_ns`
        after this node began to follow its plan.
        """
        plan, stated_ns = self.plan, member.stated_ns
        if plan is None or stated_ns is None or stated_ns - self._followed_ns <= after_ns:
            return False
        return member.revision == 0 or newer(plan.revision, member.revision, bits=_REVISION_BITS)

    def _adopt(self, plan: Search, now_ns: int) -> None:
        self.plan = plan
        self.to_tell.append(plan)
        self._told_ns, self._tellings_left = now_ns, _REPEATS

    def _tell_again(self, now_ns: int) -> None:
        """Flood a plan several times, and later again for any node that says that it follows an older one."""
        since_ns = 3 * _REPEAT_NS if self._told_ns is None else now_ns - self._told_ns
        if self.plan is None:
            return
        begins_soon_ns = self.plan.start_us * US - _REMINDS_NS
        reminds = self._told_ns is not None and self._told_ns < begins_soon_ns <= now_ns
        if since_ns < _REPEAT_NS and not reminds:
            return
        behind = any(
            self._is_behind(member, after_ns=self._notice_ns) and now_ns - member.heard_ns < _REPEAT_NS
            for node, member in self._members.items()
            if node != self._node
        )
        if self._tellings_left or (behind and since_ns > 2 * _REPEAT_NS):
            self._tellings_left = max(0, self._tellings_left - 1)
            self._told_ns = now_ns
            self.to_tell.append(self.plan)

    def _first(self, pattern: Pattern, now_ns: int, *, but: Collection[int] = ()) -> Search:
        staying = (node for node, member in self._members.items() if not member.leaves and node not in but)
        nodes = sorted(node for node in staying if node <= MOST_PLACED)[: pattern.places]
        starts = [self._members[node].position for node in nodes]
        from_middle_m = pattern.dimensions.first_m
        pattern, chosen = self._shared_out(pattern, nodes, starts)
        begins_around = pattern.dimensions.first_m > from_middle_m
        among_s = swarm_at(starts, reach_m=pattern.reach_m).apart_m / _AMONG_M_S if begins_around else 0.0
        farthest_m = max(
            pattern.at(place, 0.0).horizontal_to(start) for place, start in zip(chosen, starts, strict=True)
        )
        holders = [0] * pattern.places
        for node, place in zip(nodes, chosen, strict=True):
            holders[place] = node
        _fill(holders, pattern)
        assert self._began_ns is not None, "a plan is made in a review"
        off_ns = self._began_ns + self._take_off_ns
        if self._take_off_ns:
            off_ns += self._turns_ns({node: self._members[node].position for node in nodes})
        start_ns = max(now_ns + self._notice_ns, off_ns)
        return plan_of(
            pattern,
            tuple(holders),
            planner=self._node,
            start_us=start_ns // US,
            deploy_ds=round(10 * max(1.0, farthest_m / self._deploy_speed, among_s)),
        )._replace(revision=_next(self._newest_revision()))

    def _shared_out(
        self, pattern: Pattern, nodes: Sequence[int], starts: Sequence[Enu]
    ) -> tuple[Pattern, Sequence[int]]:
        """The fastest formation to which the UAVs fly without coming apart, and the place of each; if there is none,
        the nearest with as many teams as the fastest.
        """
        if len(nodes) == 1:
            return pattern, [(nodes[0] - 1) % pattern.places]
        nearest: tuple[Pattern, Sequence[int]] | None = None
        for begun in pattern.begun_around(starts):
            chosen, is_one = self._assigned(begun, nodes, starts)
            if is_one:
                return begun, chosen
            if nearest is None or begun.dimensions.teams == nearest[0].dimensions.teams:
                nearest = begun, chosen
        assert nearest is not None, "a formation may begin at least as it is"
        return nearest

    def _assigned(self, pattern: Pattern, nodes: Sequence[int], starts: Sequence[Enu]) -> tuple[Sequence[int], bool]:
        """The place of each UAV, and whether all stay one network on the way there."""
        absent, followers = self.absent, pattern.followers
        return keep_together(
            starts,
            [pattern.at(place, 0.0) for place in range(pattern.places)],
            lambda uav, place: _BUSY_M2 * (nodes[uav] in absent and place not in followers),
            reach_m=pattern.reach_m,
            random=self._random,
        )

    def _mended(self, plan: Search, now_ns: int) -> Search | None:
        """The plan without the UAVs that fly home, with followers in their places, and with UAVs that have come; None
        if nothing has changed.
        """
        pattern = pattern_of(plan, reach_m=0.0)
        gone = self.leavers
        holders = [0 if node in gone else node for node in plan.nodes]
        for node, member in sorted(self._members.items()):
            vacant = [place for place, holder in enumerate(holders) if self._is_up_for_grabs(holder, now_ns)]
            is_new = node <= MOST_PLACED and node not in holders and not member.leaves
            if vacant and is_new and now_ns - member.heard_ns <= _LOST_NS:
                holders[min(vacant, key=lambda place: _distance2(pattern.at(place, 0.0), member.position))] = node
        _fill(holders, pattern)
        anew = self._for_those_who_stay(pattern, holders, now_ns)
        if anew is not None:
            return anew._replace(revision=_next(plan.revision))
        if tuple(holders) == plan.nodes:
            return None
        return plan._replace(revision=_next(plan.revision), planner=self._node, nodes=tuple(holders))

    def _for_those_who_stay(self, pattern: Pattern, holders: list[int], now_ns: int) -> Search | None:
        """The plan of another formation for the UAVs that stay, once too many have flown home to span this one, and no
        further one has left just now; None if that is not so.
        """
        gone = self.leavers
        if not gone or now_ns - max(self._left_ns[node] for node in gone) < _LEAVE_NS:
            return None
        if pattern.spans(frozenset(place for place in range(pattern.dimensions.fixed) if not holders[place])):
            return None
        lost = set(self._roll_call.lost) - {self._node}
        few = self._of_few(len(self._members.keys() - gone - lost), now_ns)
        return None if few is None or few.dimensions == pattern.dimensions else self._first(few, now_ns, but=lost)

    def _is_up_for_grabs(self, holder: int, now_ns: int) -> bool:
        """True for a place that nobody holds, or a UAV that has been lost for long."""
        member = self._members.get(holder)
        return holder == 0 or (
            holder in self._roll_call.lost and (member is None or now_ns - member.heard_ns > _LOST_NS)
        )

    @property
    def leavers(self) -> set[int]:
        return {node for node, member in self._members.items() if member.leaves}

    @property
    def absent(self) -> set[int]:
        return {node for node, member in self._members.items() if member.absent}

    def _newest_revision(self) -> int:
        newest = 0
        for member in self._members.values():
            if member.revision and (not newest or newer(member.revision, newest, bits=_REVISION_BITS)):
                newest = member.revision
        return newest


def _replaces(plan: Search, mine: Search) -> bool:
    """True if a plan is newer than that in force; of two with the same number the planner with the lower id counts."""
    if plan.revision == mine.revision:
        return plan.planner < mine.planner
    return newer(plan.revision, mine.revision, bits=_REVISION_BITS)


def _next(revision: int) -> int:
    """The number of the plan after this one; numbers wrap, and 0 stands for no plan."""
    return following(revision, bits=_REVISION_BITS) or 1


def plan_of(pattern: Pattern, nodes: tuple[int, ...], *, planner: int, start_us: int, deploy_ds: int) -> Search:
    """The first plan, which assigns the places of a formation to these nodes, place by place."""
    made = pattern.dimensions
    return Search(
        start_us, made.half_width_m, made.first_m, made.last_m, made.height_m, made.speed_m_s, deploy_ds, 1, planner,
        nodes, made.lanes, made.relays, made.followers, made.shape, made.teams, made.narrower_m,
    )  # fmt: skip


def pattern_of(plan: Search, *, reach_m: float) -> Pattern:
    """The formation that a plan describes; `reach_m`: the reach of the radios."""
    return Pattern(
        Dimensions(
            plan.lanes, plan.relays, plan.followers, plan.half_width_m, plan.first_m, plan.last_m, plan.height_m,
            plan.speed_m_s, ShapeName(plan.shape), plan.teams, plan.narrower_m,
        ),
        reach_m=reach_m,
    )  # fmt: skip


def _fill(holders: list[int], pattern: Pattern) -> None:
    """Give each vacant place of a team or relay to the nearest follower; a UAV that is alone keeps its place."""
    if sum(holder != 0 for holder in holders) <= 1:
        return
    for place in range(pattern.dimensions.fixed):
        goal = pattern.at(place, 0.0)
        spare = [(_distance2(pattern.at(other, 0.0), goal), other) for other in pattern.followers if holders[other]]
        if spare and not holders[place]:
            _, other = min(spare)
            holders[place], holders[other] = holders[other], 0


def _distance2(a: Enu, b: Enu) -> float:
    return (a.east - b.east) ** 2 + (a.north - b.north) ** 2
