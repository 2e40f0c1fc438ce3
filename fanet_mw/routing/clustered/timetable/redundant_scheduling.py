"""Scheduling of floods over lossy links: frames are repeated, by one relay or by several, until they have likely
arrived.

    dose of a node    sum of -ln(loss) over the copies of a packet that were meant for it
    enough            -ln(epsilon): then all those copies are lost with a probability of at most epsilon
    holder            the root, and each node with enough: it may relay the packet, several times if others need it
    call              a frame of a node to its neighbors only, in a turn of its own: a hello, or the answer to one

Not modeled: that a relay may lack the packet although it has had enough copies (`sim/planner/flood_loss.py`).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from fanet_mw.routing.clustered.timetable.interference import (
    ONLY,
    RECEIVER,
    WINDOW,
    Geometry,
    InterferenceByPower,
    age,
    reach,
    rows,
    turn_by_turn,
)
from fanet_mw.wire.links import NEPERS


class _Offer(NamedTuple):
    """A possible transmission: a holder of a packet with a neighbor that does not have enough copies yet."""

    ready: int
    """The offset from which on the holder can transmit."""
    worth: int
    row: int
    gains: tuple[tuple[int, int], ...]
    """Each receiver, and the worth of one more copy for it."""


class Wave:
    """The flood of one packet over lossy links; a call is a wave that ends with its first frame."""

    def __init__(self, network: InterferenceByPower, root: int, *, enough: int, call: bool = False) -> None:
        self.root = root
        self.call = call
        self.sent: list[tuple[int, int]] = []
        self.goal = network.hears[root] | 1 << root if call else reach(network.hears, root)[0]
        self._network = network
        self._enough = enough
        self._has = 1 << root
        self._missing: dict[int, int] = {}
        """The dose that each row still lacks, for rows that have had part of it."""
        self._ready = {root: 0}
        self._offers: list[_Offer] | None = None

    @property
    def done(self) -> bool:
        return bool(self.sent) and (self.call or self._has == self.goal)

    def offers(self) -> list[_Offer]:
        if self._offers is None:
            self._offers = self._look()
        return self._offers

    def _look(self) -> list[_Offer]:
        network, has = self._network, self._has
        if not self.sent and self.goal == has:
            return [_Offer(0, 0, self.root, ())]  # the only node in this part of the swarm; it transmits nevertheless
        found = []
        for row, ready in self._ready.items():
            lacking = network.hears[row] & ~has
            if lacking:
                gains = tuple((other, self._gain(row, other)) for other in rows(lacking))
                found.append(_Offer(ready, sum(gain for _, gain in gains), row, gains))
        return found

    def _gain(self, row: int, other: int) -> int:
        network, enough = self._network, self._enough
        gain = RECEIVER * min(self._missing.get(other, enough), network.dose[row, other]) // enough
        return gain + (ONLY if network.hears[other] & self._has == 1 << row else 0)

    def send(self, offset: int, row: int, receivers: Sequence[int], *, hop_turns: int) -> None:
        self.sent.append((offset, row))
        for other in receivers:
            missing = self._missing[other] = self._missing.get(other, self._enough) - self._network.dose[row, other]
            if missing <= 0 and not self._has >> other & 1:
                self._has |= 1 << other
                self._ready[other] = offset + hop_turns
        self._offers = None


class _RepeatingTurn(NamedTuple):
    """The rows that transmit, must not transmit, and may be deaf for a while after a turn, as bit sets."""

    sending: int = 0
    barred: int = 0
    deaf: int = 0


class RedundantPacking:
    """Assigns the turns of one superframe to the transmissions of waves."""

    def __init__(self, network: InterferenceByPower, geometry: Geometry, *, pace: float = 1.0) -> None:
        """`pace`: the share of the superframe within which waves begin."""
        self._network = network
        self._turns = geometry.turns
        self._hop_turns = geometry.hop_turns
        self._pace = pace
        self._filled = [_RepeatingTurn()] * geometry.turns

    def place(self, waves: Sequence[Wave]) -> bool:
        turns, count = self._turns, len(waves)
        for offset, begun, under_way in turn_by_turn(waves, turns=turns, window=WINDOW, pace=self._pace):
            unbegun = begun < count or any(not wave.sent for wave in under_way.values())
            if offset >= turns and (unbegun or offset > 2 * turns):
                return False
            self._fill(offset, under_way)
        return True

    def _fill(self, offset: int, under_way: dict[int, Wave]) -> None:
        turn = offset % self._turns
        there, deaf = self._filled[turn], self._filled[turn - 1].deaf
        following = self._filled[(turn + 1) % self._turns].sending
        closed = there.sending | there.barred | deaf
        offers = sorted(
            (-offer.worth - age(wave, offset) // self._hop_turns, number, offer.row, offer)
            for number, wave in under_way.items()
            for offer in wave.offers()
            if offer.ready <= offset and not closed >> offer.row & 1
        )
        if not offers:
            return
        served: dict[int, int] = {}
        for _, number, row, offer in offers:
            if number not in under_way or (there.sending | there.barred) >> row & 1:
                continue
            receivers, worth = self._receivers(offer, there.sending | served.get(number, 0), there.sending)
            if worth < offer.worth if under_way[number].call else 2 * worth < offer.worth:
                continue
            deaf = self._deaf(there.sending | 1 << row) if following else 0
            if deaf & following:
                continue
            barred = there.barred
            for other in receivers:
                barred |= self._network.disturbing(row, other) | 1 << other
                served[number] = served.get(number, 0) | 1 << other
            there = _RepeatingTurn(there.sending | 1 << row, barred)
            under_way[number].send(offset, row, receivers, hop_turns=self._hop_turns)
            if under_way[number].done:
                del under_way[number]
        self._filled[turn] = there._replace(deaf=self._deaf(there.sending))

    def _receivers(self, offer: _Offer, out: int, sending: int) -> tuple[list[int], int]:
        """The receivers that get the frame undisturbed, and the worth of that."""
        network = self._network
        found, worth = [], 0
        for other, gain in offer.gains:
            if not out >> other & 1 and not network.disturbing(offer.row, other) & sending:
                found.append(other)
                worth += gain
        return found, worth

    def _deaf(self, sending: int) -> int:
        """The rows that receive a frame disturbed by another; they wait for EIFS then (IEEE 802.11-2020, 10.3.7)."""
        network, found = self._network, 0
        for row in rows(sending):
            for other in rows(network.senses[row] & ~sending & ~found):
                used = (row, other) in network.dose
                others = network.disturbing(row, other) if used else network.senses[other] & ~(1 << row)
                if others & sending:
                    found |= 1 << other
        return found


def enough_for(epsilon: float) -> int:
    """The dose with which all copies are lost with this probability, in grades."""
    return max(1, round(-NEPERS * math.log(epsilon)))
