"""Frames that overlap, and when a station that heard them may send: by IEEE 802.11-2020, and as ns-3.44 has it.

`python tests/ns3/eifs_timelines.py PREFIX` asks a live ns-3.44 (PREFIX: see `live.py`); the default tests ask ours.

The listener, node 1, stands 200 m (667 ns) from all others; 2 and 4 do not hear 3 and 5. All frames are 802.11b at
11 Mb/s: 984 us for 1,024 bytes, 312 us for 100. A frame that another overlaps is lost; two that begin at once are
sensed and not detected. EIFS is SIFS (10) + ACK at 1 Mb/s (304) + DIFS (50) = 364 us.

802.11-2020, 10.3.2.3.7: EIFS begins when the medium is idle after the bad frame; a good reception ends it; 10.3.4.3:
slots follow an EIFS in which the medium is idle throughout. ns-3.44 (ChannelAccessManager::GetAccessGrantStart):
SIFS + ACK from the end of the bad frame or the end of the busy medium, whichever is later, and then DIFS.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

from tests.ns3 import live

LISTENER: Final = 1
PLACES_M: Final = (0, -200, 200, -200, 200)
DIFS_US: Final = 50


class Timeline(NamedTuple):
    """What goes on the air, and when the listener's own frame then does."""

    name: str
    begins_us: tuple[tuple[int, int, int], ...]
    """Node, instant of its first bit on the air, bytes."""
    asked_us: int
    """When the listener's frame is queued. The medium is idle then."""
    standard_us: float
    """When the listener's backoff slots begin by the standard."""
    ns3_us: float
    """When its frame begins in ns-3.44: without a backoff, because the medium was idle."""


HALF_OVERLAPPED: Final = ((2, 1000, 1024), (3, 1500, 1024))
"""At the listener the first ends bad at 1984.667 us; the medium is idle from 2484.667 us, and EIFS ends at 2848.667."""

TIMELINES: Final = (
    Timeline(
        "a bad frame, and another goes on for longer than EIFS",
        HALF_OVERLAPPED,
        asked_us=2490,
        standard_us=2484.667 + 364,
        ns3_us=2490 + 50,
    ),
    Timeline(
        "a bad frame, and another goes on for 100 us",
        ((2, 1000, 1024), (3, 1100, 1024)),
        asked_us=2090,
        standard_us=2084.667 + 364,
        ns3_us=1984.667 + 364,
    ),
    Timeline(
        "a bad frame that ends last",
        ((2, 1000, 1024), (3, 1200, 100)),
        asked_us=1990,
        standard_us=1984.667 + 364,
        ns3_us=1984.667 + 364,
    ),
    Timeline(
        "a good frame within EIFS ends it",
        (*HALF_OVERLAPPED, (4, 2600, 1024)),
        asked_us=3590,
        standard_us=3584.667 + 50,
        ns3_us=3590 + 50,
    ),
    Timeline(
        "EIFS that is interrupted in its last DIFS begins anew",
        (*HALF_OVERLAPPED, (4, 2820, 1024), (5, 2820, 1024)),
        asked_us=3810,
        standard_us=3804.667 + 364,
        ns3_us=3810 + 50,
    ),
    Timeline(
        "EIFS that frames interrupt which are not detected begins anew",
        (*HALF_OVERLAPPED, (4, 2600, 1024), (5, 2600, 1024)),
        asked_us=3590,
        standard_us=3584.667 + 364,
        ns3_us=3590 + 50,
    ),
    Timeline(
        "EIFS that has passed is over for good",
        (*HALF_OVERLAPPED, (4, 3000, 1024), (5, 3000, 1024)),
        asked_us=3990,
        standard_us=3984.667 + 50,
        ns3_us=3990 + 50,
    ),
)


def asked_of(timeline: Timeline, *, difs_first: bool) -> list[tuple[int, int, int]]:
    """Node, instant at which its frame is queued [us], bytes; with `difs_first` a frame waits one DIFS, as in ns-3."""
    wait_us = DIFS_US if difs_first else 0
    others = [(node, begins_us - wait_us, size) for node, begins_us, size in timeline.begins_us]
    return [*others, (LISTENER, timeline.asked_us, 1024)]


def main() -> int:
    """Print when the listener's frame begins in a live ns-3; exit code 1 when it is not what is said above."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("prefix", type=Path, help="folder with include/ and lib64/ of ns-3.44")
    differ = 0
    with tempfile.TemporaryDirectory() as folder:
        program = live.build(flags.parse_args().prefix, Path(folder))
        print(f"{'timeline':66} {'standard':>9} {'expected':>9} {'ns-3.44':>9} us")
        for timeline in TIMELINES:
            sends = [(node, 1000 * at_us, size) for node, at_us, size in asked_of(timeline, difs_first=True)]
            began = live.transmissions(program, PLACES_M, sends)
            found_us = next(ns for node, ns in began if node == LISTENER) / 1000
            agrees = abs(found_us - timeline.ns3_us) < 0.01
            differ += not agrees
            print(
                f"{timeline.name:66} {timeline.standard_us:9.3f} {timeline.ns3_us:9.3f} {found_us:9.3f}"
                f"{'' if agrees else '  DIFFERS'}"
            )
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
