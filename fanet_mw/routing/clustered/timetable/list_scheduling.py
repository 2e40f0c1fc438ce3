"""List scheduling of floods: turn after turn is filled with as many transmissions as do not disturb each other.

    for each turn: list the transmissions that all floods under way could make now, each with the nodes that lack the
                   packet around its sender; take them in the order of their worth, the oldest flood first among
                   equals, as long as none disturbs one that is already taken (`interference.py`)

Floods begin evenly over the superframe, or over a part of it when turns are scarce. Each node sends a packet at most
once; a neighbor that only this node can serve counts half more. With more `tries` the fullest of several slightly
random orders is taken. A flood that is not complete at the last turn continues in the next superframe; unused turns
become spare turns (`spare`). Integers and one named random stream give all machines the same result, in about 0.5 ms
per packet and try for 45 nodes.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

from fanet_mw.rng import stream
from fanet_mw.routing.clustered.timetable.interference import (
    ONLY,
    RECEIVER,
    WINDOW,
    Geometry,
    InterferenceByDistance,
    age,
    rows,
    turn_by_turn,
)

_NOISE: Final = 50
_TRIAL: Final = 64
_HOPE: Final = 1.15
"""After `_TRIAL` turns with the window full, scheduling ends if the rest must go faster by this factor."""


class Effort(NamedTuple):
    """The effort that is spent on filling turns."""

    pace: float = 1.0
    """The share of the superframe within which floods begin."""
    tries: int = 1
    """The number of ways in which each turn is filled, of which the best is taken."""


class Flood:
    """The flood of one packet, as far as it is scheduled."""

    def __init__(self, swarm: InterferenceByDistance, root: int, way: list[int]) -> None:
        self.root = root
        self.goal, self.hops = swarm.part(root)
        self.sent: list[tuple[int, int]] = []
        self._hears = swarm.hears
        self._way = way
        """The rows that must transmit first, in this order."""
        self._has = 1 << root
        self._ready = {root: 0}
        """From which turn on each holder of the packet can send it, as long as a neighbor lacks it."""
        self._served = swarm.hears[root]
        """The rows that hear a holder of the packet."""
        self._twice = 0
        """Those that hear several."""
        self._offers: list[tuple[int, int, int, int]] | None = None

    @property
    def done(self) -> bool:
        return self._has == self.goal and bool(self.sent)

    def offers(self) -> list[tuple[int, int, int, int]]:
        """(first offset, worth, row, receivers) of each holder with a neighbor that lacks the packet."""
        if self._offers is None:
            self._offers = self._look()
        return self._offers

    def _look(self) -> list[tuple[int, int, int, int]]:
        hears, has = self._hears, self._has
        if not self.sent and self._has == self.goal:
            return [(0, 0, self.root, 0)]  # the only node in this part of the swarm; it transmits nevertheless
        while self._way and not hears[self._way[0]] & ~has:
            self._way.pop(0)
        found, done = [], []
        for row in self._way[:1] or self._ready:
            lacking = hears[row] & ~has
            if lacking:
                only = (lacking & ~self._twice).bit_count()
                found.append((self._ready[row], RECEIVER * lacking.bit_count() + ONLY * only, row, lacking))
            else:
                done.append(row)
        for row in done:
            del self._ready[row]
        return found

    def send(self, offset: int, row: int, receivers: int, *, hop_turns: int) -> None:
        """A row transmits in a turn, after which these receivers have the packet."""
        self.sent.append((offset, row))
        self._has |= receivers
        for other in rows(receivers):
            self._ready.setdefault(other, offset + hop_turns)
            self._twice |= self._served & self._hears[other]
            self._served |= self._hears[other]
        self._offers = None


class _FilledTurn(NamedTuple):
    """The content of a turn as bit sets: the rows that transmit, are meant, hear one sender, and hear more than one."""

    sending: int = 0
    meant: int = 0
    disturbed: int = 0
    deaf: int = 0


_EMPTY: Final = _FilledTurn()
_Offer = tuple[int, int, int, int]
"""A possible transmission: its worth, minus the number of its flood, its row, and its receivers."""
_Offered = tuple[int, int, list[tuple[int, int, int, int]]]
"""What one flood could send: how much more its age makes it worth, minus its number, and `Flood.offers`."""
_Choice = tuple[int, list[_Offer], _FilledTurn]
"""The sum of the worth of some transmissions, these transmissions, and the turn with them."""


class Packing:
    """Assigns the turns of one superframe to the transmissions of floods."""

    def __init__(self, swarm: InterferenceByDistance, geometry: Geometry, effort: Effort) -> None:
        self._disturbs = swarm.disturbs
        self._turns = geometry.turns
        self._hop_turns = geometry.hop_turns
        self._pace, self._tries = effort
        self._random = stream(0, "timetable", 0).random
        self._filled = [_EMPTY] * geometry.turns

    def place(self, floods: Sequence[Flood]) -> bool:
        turns, count = self._turns, len(floods)
        hops = max((flood.hops for flood in floods), default=0)
        # besides the window, the floods that wait for the next hop because relaying takes several turns
        window = WINDOW * (2 if self._tries > 1 else 1) + self._hop_turns * hops * count // turns
        full_from, full_done = 0, 0
        for offset, begun, under_way in turn_by_turn(floods, turns=turns, window=window, pace=self._pace):
            done = begun - len(under_way)
            if len(under_way) < window:
                full_from, full_done = offset, done
            if offset >= turns:
                late = begun < count or any(not flood.sent for flood in under_way.values())
                late = late or offset > 3 * turns + self._hop_turns * len(self._disturbs)
            else:
                left = max(0, count - window - done)
                late = _will_be_late(left, turns - offset, done=done - full_done, within=offset - full_from)
            if late:
                return False
            if under_way:
                self._fill(offset, under_way)
        return True

    def _fill(self, offset: int, under_way: dict[int, Flood]) -> None:
        offers = self._offers(offset, under_way)
        if not offers:
            return
        turn, following = offset % self._turns, self._filled[(offset + 1) % self._turns].sending
        offers.sort(reverse=True)
        best = self._choose(offers, self._filled[turn], following)
        for _ in range(1, self._tries):
            other = self._choose(self._shuffled(offers), self._filled[turn], following)
            if other[0] > best[0]:
                best = other
        _, chosen, self._filled[turn] = best
        for _, number, row, receivers in chosen:
            under_way[-number].send(offset, row, receivers, hop_turns=self._hop_turns)
            if under_way[-number].done:
                del under_way[-number]

    def spare(self, hears: Sequence[int]) -> list[list[int]]:
        """For each row, turns that reach all neighbors and disturb no flood; who has fewest chooses first."""
        found: list[list[int]] = [[] for _ in hears]
        for turn in range(self._turns):
            wanted = ((0, -row, [(0, -len(turns), row, hears[row])]) for row, turns in enumerate(found) if hears[row])
            following = self._filled[(turn + 1) % self._turns].sending
            offers = sorted(self._possible(turn, wanted), reverse=True)
            _, chosen, self._filled[turn] = self._choose(offers, self._filled[turn], following)
            for _, _, row, _ in chosen:
                found[row].append(turn)
        return found

    def _offers(self, offset: int, under_way: dict[int, Flood]) -> list[_Offer]:
        """The transmissions of floods that would be possible in this turn if no other one used it."""
        wanted = (
            (age(flood, offset) // self._hop_turns, -number, flood.offers()) for number, flood in under_way.items()
        )
        return self._possible(offset, wanted)

    def _possible(self, offset: int, wanted: Iterable[_Offered]) -> list[_Offer]:
        """Those transmissions that disturb none for which this turn is taken, nor are disturbed by one."""
        sending, meant, disturbed, _ = self._filled[offset % self._turns]
        following = self._filled[(offset + 1) % self._turns].sending
        barred = self._filled[(offset - 1) % self._turns].deaf | sending | disturbed
        spared = meant | disturbed & following
        disturbs = self._disturbs
        return [
            (worth + more, number, row, receivers)
            for more, number, offers in wanted
            for ready, worth, row, receivers in offers
            if ready <= offset and not (barred >> row & 1 or disturbs[row] & spared or receivers & disturbed)
        ]

    def _shuffled(self, offers: list[_Offer]) -> list[_Offer]:
        random: Callable[[], float] = self._random
        keyed = [(worth + int(random() * _NOISE), index) for index, (worth, _, _, _) in enumerate(offers)]
        return [offers[index] for _, index in sorted(keyed, reverse=True)]

    def _choose(self, offers: Sequence[_Offer], there: _FilledTurn, following: int) -> _Choice:
        """Take transmissions in order, if they disturb none taken; no receiver gets the same packet twice."""
        sending, meant, disturbed, deaf = there
        spared = meant | disturbed & following
        disturbs = self._disturbs
        chosen: list[_Offer] = []
        served: dict[int, int] = {}
        total = 0
        for offer in offers:
            worth, number, row, receivers = offer
            around = disturbs[row]
            if (
                (disturbed | sending) >> row & 1
                or around & spared
                or receivers & disturbed
                or receivers & served.get(number, 0)
            ):
                continue
            sending |= 1 << row
            meant |= receivers
            deaf |= disturbed & around
            disturbed |= around
            spared = meant | disturbed & following
            served[number] = served.get(number, 0) | receivers
            total += worth
            chosen.append(offer)
        return total, chosen, _FilledTurn(sending, meant, disturbed, deaf)


def _will_be_late(left: int, turns: int, *, done: int, within: int) -> bool:
    """True if floods end too slowly: `done` of them ended within `within` turns in which the window was full."""
    return within >= _TRIAL and left * within > _HOPE * done * turns
