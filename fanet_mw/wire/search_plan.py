"""The messages by which UAVs agree on the plan of a search: their statuses, and the plan."""

from typing import Any, Final, NamedTuple, Self

from fanet_mw.errors import LocalProtocolError
from fanet_mw.units import FARTHEST_M, Enu
from fanet_mw.wire.checks import refuse_unless
from fanet_mw.wire.frame import ANY_NODE, LATEST_US, SEARCH, STATUS, VERSION, encode_inner, encode_truncated

MOST_PLACES: Final = 200
"""The number of places of a formation that one message can assign."""
MOST_PLACED: Final = 255
"""The greatest id of a UAV that can have a place: a plan names each by one byte."""
_LINES: Final = 0
_SPIRAL: Final = 1
_FAN: Final = 5
_LAST_SHAPE: Final = _FAN
_LEAST_M: Final = 1.0
"""The least value of those lengths of a formation that must not be 0."""
_FASTEST_M_S: Final = 1000.0


class Search(NamedTuple):
    """FANET_SEARCH: the plan of a search."""

    start_us: int
    half_width_m: float
    first_m: float
    last_m: float
    height_m: float
    speed_m_s: float
    deploy_ds: int
    revision: int
    planner: int
    nodes: tuple[int, ...]
    """The node at each place; 0 if the place is vacant."""
    lanes: int
    relays: int
    followers: int
    shape: int = 0
    """0: lines, 1: spiral, 2: sectors, 3: ring, 4: circuit, 5: fan."""
    teams: int = 2
    narrower_m: float = 0.0
    """Lines: by how much nearer to the middle the outermost lanes begin the first sweep."""

    def encode_frame(self, node: int) -> bytes:
        if len(self.nodes) > MOST_PLACES:
            raise LocalProtocolError(f"a plan of {len(self.nodes)} places must have <= {MOST_PLACES}")
        if max(self.nodes, default=0) > MOST_PLACED:
            raise LocalProtocolError(f"a plan of UAV {max(self.nodes)}; each must be <= {MOST_PLACED}")
        unused = (0,) * (MOST_PLACES - len(self.nodes))
        counts = self.lanes, self.relays, self.followers, self.shape, self.teams
        packed = SEARCH.layout.pack(*self[:6], self.narrower_m, *self[6:9], *counts, VERSION, *self.nodes, *unused)
        return encode_truncated(SEARCH, packed, node=node)

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        lanes, relays, followers, shape, teams, version = fields[10:16]
        places = teams * lanes + relays + followers
        in_lines = shape == _LINES and teams >= 2 and teams % 2 == 0 and lanes >= 2
        other = _LINES < shape <= _LAST_SHAPE and teams >= 1 and lanes >= 1 and relays == 0
        refuse_unless(
            version == VERSION and (in_lines or other) and places <= MOST_PLACES,
            f"a plan of {places} places in {teams} teams, shape {shape}",
        )
        nodes, narrower_m = fields[16 : 16 + places], fields[6]
        plan = cls._make((*fields[:6], *fields[7:10], nodes, lanes, relays, followers, shape, teams, narrower_m))
        named = [node for node in nodes if node]
        refuse_unless(
            plan.start_us <= LATEST_US
            and 0 < plan.planner < ANY_NODE
            and plan.revision > 0
            and len(set(named)) == len(named),
            f"plan {plan.revision} of {plan.planner}",
        )
        lengths = (plan.half_width_m, narrower_m, plan.first_m, plan.last_m, plan.height_m)
        refuse_unless(
            0 <= narrower_m <= plan.half_width_m <= FARTHEST_M
            and 0 <= plan.height_m <= FARTHEST_M
            and (_has_far_sides(plan) if shape == _FAN else _sweeps(plan))
            and 0.1 <= plan.speed_m_s <= _FASTEST_M_S,
            f"a formation of {lengths} m at {plan.speed_m_s} m/s",
        )
        return plan


def _sweeps(plan: Search) -> bool:
    """True if a formation has a way to sweep."""
    return (
        0 <= plan.first_m <= FARTHEST_M
        and 0 <= plan.last_m <= FARTHEST_M
        and plan.last_m - plan.first_m >= (0.0 if plan.shape == _SPIRAL else _LEAST_M)
        and (plan.shape == _LINES or (plan.first_m >= _LEAST_M and plan.half_width_m >= _LEAST_M))
    )


def _has_far_sides(plan: Search) -> bool:
    """True if the base of a fan, which `first_m` and `last_m` name, is outside the area."""
    east_m, north_m = abs(plan.first_m), abs(plan.last_m)
    is_outside = max(east_m, north_m) >= plan.half_width_m >= _LEAST_M
    return is_outside and east_m <= FARTHEST_M and north_m <= FARTHEST_M


class SearchStatus(NamedTuple):
    """FANET_STATUS: the position and the state of a UAV."""

    t_us: int
    position: Enu
    node: int
    revision: int
    charge: int
    """The percentage of the battery that may be spent above the way home and a reserve; 0: it flies home."""
    absent: bool = False
    """True while the UAV is out of its place for a survivor, so that others close ranks until it comes back."""

    def encode_frame(self, node: int) -> bytes:
        payload = STATUS.layout.pack(self.t_us, *self.position, *self[2:], VERSION)
        return encode_inner(STATUS, payload, node=node)

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        t_us, east, north, up, node, revision, charge, absent, version = fields
        position = Enu(east, north, up)
        refuse_unless(
            version == VERSION
            and 0 < node < ANY_NODE
            and t_us <= LATEST_US
            and charge <= 100
            and absent <= 1
            and position.is_within(FARTHEST_M),
            f"status of {node}: {position}, {charge} %, absent {absent}",
        )
        return cls(t_us, position, node, revision, charge, bool(absent))
