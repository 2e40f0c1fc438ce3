"""The share of nodes that have a packet when its flood is over, and after so many rounds of repair: a simulation.

    flood    each frame of the table is drawn for each of its receivers, in order: a node that has the packet, sends it
    round    a node that lacks it says so in its hello, and a neighbor answers in a turn of its own

A frame that another in the same turn disturbs is lost. `_TRIALS` floods of each root are drawn side by side, as the
bits of integers, from one named random stream: the same everywhere. Losses are independent from frame to frame, as
`LinkQuality` measured them. Of a round the best neighbor alone counts, which must hear the hello and be heard. Not
modeled: that many ask at once, so that an answer waits for the next turn but one.
"""

from collections.abc import Mapping, Sequence
from math import exp, fsum
from typing import Final, NamedTuple

from fanet_mw.rng import stream
from fanet_mw.routing.clustered.timetable.redundant_scheduling import Network
from fanet_mw.routing.clustered.timetable.turn_filling import rows
from fanet_mw.units import NodeId
from fanet_mw.wire.links import NEPERS

_TRIALS: Final = 256
_DIGITS: Final = 8
"""The binary digits of a probability."""
ROUNDS: Final = 6
Sent = tuple[int, int]
"""(offset, row)."""


class Odds(NamedTuple):
    """The deliveries to be expected of a timetable for lossy links."""

    missed: Mapping[NodeId, tuple[float, ...]]
    """The share of nodes that lack the packet of each root after no round of repair, after one, and so on."""

    @property
    def mean(self) -> float:
        """The share of copies that floods alone leave out."""
        return fsum(row[0] for row in self.missed.values()) / len(self.missed)

    def rounds(self, root: NodeId, *, missed: float) -> int | None:
        """The number of rounds after which no more than this share is missing; None: more than are reckoned with."""
        return next((count for count, share in enumerate(self.missed[root]) if share <= missed), None)


def odds(network: Network, floods: Sequence[tuple[NodeId, Sequence[Sent]]], *, turns: int, hop_turns: int) -> Odds:
    """The odds of the floods of a table: `floods` has the root of each, and its frames in order."""
    together: dict[int, int] = {}
    for _, sent in floods:
        for offset, row in sent:
            together[offset % turns] = together.get(offset % turns, 0) | 1 << row
    chance = {pair: _binary(1 - exp(-grade / NEPERS)) for pair, grade in network.dose.items()}
    answered = [_answered(network, row) for row in range(len(network.nodes.ids))]
    draw = _Draw()
    lacking: dict[NodeId, list[list[float]]] = {}
    for root, sent in floods:
        missing = _flood(network, network.nodes.row[root], sent, together, chance, draw, turns, hop_turns)
        lacking.setdefault(root, []).append(missing)
    return Odds(
        {
            root: tuple(
                fsum(share * (1 - answered[row]) ** count for missing in every for row, share in enumerate(missing))
                / len(every)
                / max(1, len(network.nodes.ids) - 1)
                for count in range(ROUNDS + 1)
            )
            for root, every in sorted(lacking.items())
        }
    )


def _flood(
    network: Network,
    root: int,
    sent: Sequence[Sent],
    together: Mapping[int, int],
    chance: Mapping[tuple[int, int], int],
    draw: "_Draw",
    turns: int,
    hop_turns: int,
) -> list[float]:
    """The share of trials in which each row lacks the packet."""
    everywhere = (1 << _TRIALS) - 1
    has = [0] * len(network.nodes.ids)
    has[root] = everywhere
    late: list[tuple[int, int, int]] = []
    """(from which offset on, row, in which trials) it can relay."""
    for offset, row in sent:
        while late and late[0][0] <= offset:
            _, other, trials = late.pop(0)
            has[other] |= trials
        sending = together[offset % turns]
        late += [
            (offset + hop_turns, other, has[row] & draw.bits(chance[row, other]))
            for other in rows(network.hears[row] & ~sending)
            if not network.disturbing(row, other) & sending
        ]
    for _, other, trials in late:
        has[other] |= trials
    return [1 - trials.bit_count() / _TRIALS for trials in has]


def _answered(network: Network, row: int) -> float:
    """The chance that a node's hello is heard by its best neighbor, and the answer by the node."""
    grades = [network.dose[row, other] for other in rows(network.hears[row])]
    best = 1 - exp(-max(grades, default=0) / NEPERS)
    return best * best


def _binary(chance: float) -> int:
    """A probability in binary digits, rounded down."""
    return min((1 << _DIGITS) - 1, int(chance * (1 << _DIGITS)))


class _Draw:
    """Random bits that are set with a given probability."""

    def __init__(self) -> None:
        self._bits = stream(0, "odds", 0).getrandbits

    def bits(self, chance: int) -> int:
        """Draw one bit for each trial: from the last binary digit of the chance up, a 1 takes the OR with fresh random
        bits, a 0 the AND.
        """
        found = 0
        for digit in range(_DIGITS):
            drawn = self._bits(_TRIALS)
            found = found | drawn if chance >> digit & 1 else found & drawn
        return found
