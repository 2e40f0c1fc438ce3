"""FANET_COVERED: the cells of the area that have been searched, as far as the sender knows.

Like all messages of this dialect (`fanet_mw.wire`) it is coded by struct. Any bytes decode to a message or to
MalformedFrameError; values that no node of this project would send are malformed.
"""

from typing import Any, Final, NamedTuple, Self

from fanet_mw.wire.checks import refuse_unless
from fanet_mw.wire.frame import COVERED, VERSION, Packed, decode_first, encode_inner

COVERED_SIDE: Final = 32
"""The number of rows and columns of cells into which the area is divided for the map of searched cells."""
_COVERED_BYTES: Final = COVERED_SIDE * COVERED_SIDE // 8


class Covered(NamedTuple):
    """FANET_COVERED: the cells of the area that have been searched, as far as its sender knows."""

    cells: int
    """Bit `COVERED_SIDE * row + column` is that of a cell, from the south-western corner of the area."""

    def encode_frame(self, node: int) -> bytes:
        cells = self.cells.to_bytes(_COVERED_BYTES, "little")
        return encode_inner(COVERED, COVERED.layout.pack(*cells, VERSION), node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        """The first FANET_COVERED in a frame; raises MalformedFrameError."""
        return cls.checked(decode_first(COVERED, packed))

    @classmethod
    def checked(cls, fields: tuple[Any, ...]) -> Self:
        """The cells of these fields; raises MalformedFrameError."""
        *cells, version = fields
        refuse_unless(version == VERSION, f"covered cells of version {version}")
        return cls(int.from_bytes(cells, "little"))
