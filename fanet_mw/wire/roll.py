"""FANET_ROLL: when each UAV of the plan was last heard by anybody, as far as the sender knows, and who is lost."""

from typing import Any, Final, NamedTuple, Self

from fanet_mw.errors import LocalProtocolError
from fanet_mw.units import MS
from fanet_mw.wire.checks import refuse_unless
from fanet_mw.wire.frame import ANY_NODE, ROLL, VERSION, Packed, decode_first, encode_inner
from fanet_mw.wire.search_plan import MOST_PLACES

ROLL_NS: Final = 500 * MS
"""The unit in which instants are told, by swarm time; a whole one, so that nothing is lost from hop to hop."""
LONG_AGO: Final = 127
"""An entry that says no more than that a UAV was heard this many units ago or before that, or never."""
_LOST: Final = 0x80
"""The bit of an entry that says that the UAV is lost: those who heard it have not for some time."""


class Roll(NamedTuple):
    """FANET_ROLL: the UAVs of a plan, as they were last heard."""

    at: int
    """The instant of the sender, in units of `ROLL_NS`."""
    planner: int
    revision: int
    """With `planner` the plan whose places are told."""
    ages: tuple[int, ...]
    """How long before `at` the UAV of each place was last heard, in units of `ROLL_NS`, at most `LONG_AGO`."""
    lost: frozenset[int]
    """The places whose UAVs are lost."""

    def encode_frame(self, node: int) -> bytes:
        if len(self.ages) > MOST_PLACES:
            raise LocalProtocolError(f"a roll of {len(self.ages)} places must have <= {MOST_PLACES}")
        entries = [min(age, LONG_AGO) | (_LOST if place in self.lost else 0) for place, age in enumerate(self.ages)]
        unused = (LONG_AGO,) * (MOST_PLACES - len(entries))
        return encode_inner(
            ROLL, ROLL.layout.pack(self.at, self.planner, self.revision, *entries, *unused, VERSION), node=node
        )

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first FANET_ROLL in a frame; raises MalformedFrameError."""
        return cls.checked(decode_first(ROLL, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        at, planner, revision, *entries, version = fields
        refuse_unless(version == VERSION and 0 < planner < ANY_NODE and revision > 0, f"roll of {planner}, {revision}")
        lost = frozenset(place for place, entry in enumerate(entries) if entry & _LOST)
        return cls(at, planner, revision, tuple(entry & ~_LOST for entry in entries), lost)
