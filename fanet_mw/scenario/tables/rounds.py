"""The `[rounds]` table: turns in a fixed order that depend on nothing but the number of nodes."""

from typing import Annotated

from pydantic import Field

from fanet_mw.scenario.tables.sections import Milliseconds, Section


class Rounds(Section):
    """`routing.protocol = "rounds"`: every node has one turn in each round, whatever moves; bulk uses the rest."""

    turn_bytes: Annotated[int, Field(ge=100, le=16_384)] = 600
    """The size of frame that a turn holds."""
    turn_slack_us: Annotated[float, Field(ge=0, le=1e6)] = 50.0
    """By how much a turn is longer than its frame. A bound is stated while it holds twice the bound of a clock's error,
    and some 20 us for propagation and detection."""
    bulk_share: Annotated[float, Field(ge=0, le=0.95)] = 0.7
    """Share of a round whose slots are for bulk (0 to 0.95); 0: bulk goes in turns, too."""
    least_period_ms: Milliseconds = 0.0
    """The shortest round; 0: as short as the turns and `bulk_share` allow."""
    repeats: Annotated[int, Field(ge=0, le=64)] = 16
    """How often a node sends a packet again that a neighbor is not known to have, while it is not older than its
    lifetime."""
    burst_bytes: Annotated[int, Field(ge=0, le=1_000_000)] = 4096
    """The bytes of urgent packets that may be under way at the same time under a stated bound; while a node hears of
    more it states none."""
    repair_s: Annotated[float, Field(ge=0, le=1e6)] = 10.0
    """Neighbors send packets again that a node lacks, as its hellos show, if they are newer than this; 0: no repair."""
