"""Simulates the floods of a timetable over lossy links: which share of nodes has a packet afterwards, and after
repairs.

`_TRIALS` floods of each root are simulated side by side, one in each bit of an integer, with one named random stream,
alike at all nodes. In a round of repair only the best neighbor counts. Not modeled: that several nodes ask at once, so
that an answer waits longer than until the next turn but one.
"""

from collections.abc import Mapping, Sequence
from math import exp, fsum
from typing import Final, NamedTuple

from fanet_mw.rng import stream
from fanet_mw.routing.clustered.timetable.interference import InterferenceByPower, rows
from fanet_mw.units import NodeId
from fanet_mw.wire.links import NEPERS

_TRIALS: Final = 256
_DIGITS: Final = 8
"""The number of binary digits with which probabilities are represented."""
ROUNDS: Final = 6
Sent = tuple[int, int]
"""The offset of a turn, and the row of the node that transmits in it."""


class Odds(NamedTuple):
    """The deliveries to be expected of a timetable over lossy links."""

    missed: Mapping[NodeId, tuple[float, ...]]
    """By root: the share of nodes that lack its packet after the flood, after one round of repair, and so on."""

    @property
    def mean(self) -> float:
        """The share of copies that are missing after the flood alone."""
        return fsum(row[0] for row in self.missed.values()) / len(self.missed)

    def rounds(self, root: NodeId, *, missed: float) -> int | None:
        """Rounds of repair after which at most this share is missing; None if no simulated one achieves it."""
        return next((count for count, share in enumerate(self.missed[root]) if share <= missed), None)


def odds(
    network: InterferenceByPower, floods: Sequence[tuple[NodeId, Sequence[Sent]]], *, turns: int, hop_turns: int
) -> Odds:
    """The odds of the floods of a timetable. `floods` has the root of each flood, and its frames in order."""
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
    network: InterferenceByPower,
    root: int,
    sent: Sequence[Sent],
    together: Mapping[int, int],
    chance: Mapping[tuple[int, int], int],
    draw: "_Draw",
    turns: int,
    hop_turns: int,
) -> list[float]:
    """The share of trials in which each row lacks the packet after the flood."""
    everywhere = (1 << _TRIALS) - 1
    has = [0] * len(network.nodes.ids)
    has[root] = everywhere
    late: list[tuple[int, int, int]] = []
    """Holders that can relay only later: from which offset on, the row, and the trials in which it has the packet."""
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


def _answered(network: InterferenceByPower, row: int) -> float:
    """The probability that a node's best neighbor receives its hello and the node receives the answer."""
    grades = [network.dose[row, other] for other in rows(network.hears[row])]
    best = 1 - exp(-max(grades, default=0) / NEPERS)
    return best * best


def _binary(chance: float) -> int:
    """A probability as binary digits, rounded down."""
    return min((1 << _DIGITS) - 1, int(chance * (1 << _DIGITS)))


class _Draw:
    """Draws random bits, each of which is 1 with a given probability."""

    def __init__(self) -> None:
        self._bits = stream(0, "odds", 0).getrandbits

    def bits(self, chance: int) -> int:
        """One bit for each trial, from the probability's digits, last to first: a 1 is OR with fresh bits, a 0 AND."""
        found = 0
        for digit in range(_DIGITS):
            drawn = self._bits(_TRIALS)
            found = found | drawn if chance >> digit & 1 else found & drawn
        return found
