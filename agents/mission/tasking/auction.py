"""The auction that decides which UAVs fly to a survivor: neighbors pass on bids in their hellos until all agree.

    a task needs n UAVs: of all known bids, the n with the earliest times of arrival win; of equal ones the lower id

Nodes that have received the same bids name the same winners, in whatever order they came: the consensus of CBBA (Choi,
Brunet, How, IEEE Transactions on Robotics 25(4), 2009), for single tasks. A winner that falls silent is forgotten after
a while, and its task is open again.
"""

from collections.abc import Iterable
from typing import Final, NamedTuple

from fanet_mw.serial_number import following, newer
from fanet_mw.units import NodeId, S
from fanet_mw.wire.search_messages import MOST_BIDS, WITHDRAWN, Bid

_FORGOTTEN_NS: Final = 15 * S
"""How long a bid counts if its bidder does not confirm it."""
_SERIAL_BITS: Final = 16
_OLDEST_S: Final = 255
"""The greatest age of a bid that a message can state."""


class _KnownBid(NamedTuple):
    eta_ds: int
    """The time in which the bidder could arrive, in tenths of a second; `WITHDRAWN` if the bid was withdrawn."""
    serial: int
    """The serial number of the bid; each new bid of a bidder has the next one (16 bits)."""
    stood_ns: int
    """The latest instant at which the bidder is known to have stated the bid."""


class Auction:
    """The bids that one node knows: its own, and the newest bid of each other bidder."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self._bids: dict[int, dict[int, _KnownBid]] = {}
        self._serial = 0

    def bid(self, survivor: int, *, eta_s: float, now_ns: int) -> None:
        self._place(survivor, max(0, min(WITHDRAWN - 1, round(10 * eta_s))), now_ns)

    def withdraw(self, survivor: int, *, now_ns: int) -> None:
        mine = self._bids.get(survivor, {}).get(self._node)
        if mine is not None and mine.eta_ds != WITHDRAWN:
            self._place(survivor, WITHDRAWN, now_ns)

    def merge(self, bids: Iterable[Bid], *, now_ns: int) -> None:
        """Take in others' bids; of its own only serial numbers, so that the next is newer after a restart."""
        for bid in bids:
            stood_ns = now_ns - bid.age_s * S
            if stood_ns < now_ns - _FORGOTTEN_NS:
                continue
            of_task = self._bids.setdefault(bid.survivor, {})
            known = of_task.get(bid.bidder)
            if bid.bidder == self._node:
                if not newer(following(self._serial, bits=_SERIAL_BITS), bid.serial, bits=_SERIAL_BITS):
                    self._serial = bid.serial
            elif known is None or _is_over(known, now_ns) or _replaces(bid.serial, stood_ns, known):
                of_task[bid.bidder] = _KnownBid(bid.eta_ds, bid.serial, stood_ns)

    def close(self, survivor: int) -> None:
        self._bids.pop(survivor, None)

    def has_bid(self, survivor: int) -> bool:
        mine = self._bids.get(survivor, {}).get(self._node)
        return mine is not None and mine.eta_ds != WITHDRAWN

    def winners(self, survivor: int, *, count: int, now_ns: int) -> list[int]:
        """The `count` bidders with the earliest times of arrival, the earliest first."""
        standing = [
            (known.eta_ds, bidder)
            for bidder, known in self._bids.get(survivor, {}).items()
            if known.eta_ds != WITHDRAWN and self._counts(bidder, known, now_ns)
        ]
        return [bidder for _, bidder in sorted(standing)[:count]]

    def would_win(self, survivor: int, *, eta_s: float, count: int, now_ns: int) -> bool:
        """True if a bid of this node with this time of arrival would be among the `count` best."""
        before = self.winners(survivor, count=count, now_ns=now_ns)
        if len(before) < count:
            return True
        worst = before[-1]
        return (round(10 * eta_s), self._node) < (self._bids[survivor][worst].eta_ds, worst)

    def bids_to_tell(self, tasks: Iterable[int], *, now_ns: int) -> list[Bid]:
        """Bids for these tasks, as many as a message holds: the node's own first, then by time of arrival."""
        own: list[Bid] = []
        others: list[tuple[int, Bid]] = []
        for survivor in tasks:
            for bidder, known in sorted(self._bids.get(survivor, {}).items()):
                if not self._counts(bidder, known, now_ns):
                    continue
                age_s = 0 if bidder == self._node else min(_OLDEST_S, -((known.stood_ns - now_ns) // S))
                bid = Bid(survivor, bidder, known.eta_ds, known.serial, age_s)
                if bidder == self._node:
                    own.append(bid)
                else:
                    others.append((known.eta_ds, bid))
        others.sort()
        return [*own, *(bid for _, bid in others)][:MOST_BIDS]

    def _place(self, survivor: int, eta_ds: int, now_ns: int) -> None:
        self._serial = following(self._serial, bits=_SERIAL_BITS)
        self._bids.setdefault(survivor, {})[self._node] = _KnownBid(eta_ds, self._serial, now_ns)

    def _counts(self, bidder: int, known: _KnownBid, now_ns: int) -> bool:
        """True for a bid of this node, and for one that its bidder has stated recently."""
        return bidder == self._node or not _is_over(known, now_ns)


def _is_over(known: _KnownBid, now_ns: int) -> bool:
    """True for a bid that its bidder has not stated for long. If it was started again, it numbers its bids anew."""
    return now_ns - known.stood_ns > _FORGOTTEN_NS


def _replaces(serial: int, stood_ns: int, known: _KnownBid) -> bool:
    """True for a newer bid of the same bidder, and for the known one if it was stated later."""
    if serial == known.serial:
        return stood_ns > known.stood_ns
    return newer(serial, known.serial, bits=_SERIAL_BITS)
