"""Reports to the applications of a node what has become of their messages.

    a packet is announced, transmitted or dropped    ->  `Node.watch`, for packets that are watched
    a message is acknowledged, or has expired        ->  `Sender.told`

Applications are told after the input was handled, so that none is called while it is calling itself.
"""

from collections import Counter, deque
from typing import Final, NamedTuple

from fanet_mw.application import Application, Fate, Status
from fanet_mw.delivery.sender import EXPIRED, Told
from fanet_mw.errors import DropReason
from fanet_mw.node.header_check import CONTROL
from fanet_mw.node.node import Node
from fanet_mw.node.packet_watch import PacketNews, RadioStage
from fanet_mw.units import seconds_to_ns
from fanet_mw.wire import PRIORITY_BULK
from fanet_mw.wire.application_message import DELIVERED, NO_LISTENER

_MOST_WATCHED: Final = 8192
"""The greatest number of packets whose application is remembered."""
_OUTCOMES: Final = {EXPIRED: Fate.EXPIRED, DELIVERED: Fate.ACKNOWLEDGED, NO_LISTENER: Fate.UNWANTED}
_STAGES: Final = {
    RadioStage.ANNOUNCED: Fate.LET_OUT,
    RadioStage.SENT: Fate.SENT,
    RadioStage.NOT_TRIED: Fate.TURNED_AWAY,
}
_REASONS: Final = {DropReason.ADMISSION: Fate.REFUSED, DropReason.EXPIRED: Fate.EXPIRED}
"""The fates of packets that are dropped for these reasons; for all other reasons it is DROPPED."""


class _Watched(NamedTuple):
    """The application and the message to which a packet belongs."""

    application: Application
    handle: int
    first: bool
    confirmed: bool
    """True for a piece of a confirmed message; if such a piece is dropped, it is sent again."""


class Statuses:
    """The statuses of one node's messages that have yet to be reported."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._owners: dict[int, Application] = {}
        """The application that has sent each unfinished confirmed message, by the message's handle."""
        self._watched: dict[int, _Watched] = {}
        self.waiting: deque[tuple[Application, Status]] = deque()
        self.counts: Counter[str] = Counter()

    def tell(self, application: Application, status: Status) -> None:
        if status.handle & CONTROL:
            self.counts[status.fate.value] += 1
        if status.fate in application.follows:
            self.waiting.append((application, status))

    def own(self, handle: int, application: Application) -> None:
        self._owners[handle] = application

    def owner(self, handle: int) -> Application | None:
        """The application that has sent a confirmed message; None if the message is finished."""
        return self._owners.get(handle)

    def watch(self, seq: int, application: Application, handle: int, *, first: bool, confirmed: bool) -> None:
        """Remember to which application's message a packet belongs, whether it carries all of it or a piece."""
        self._watched[seq] = _Watched(application, handle, first, confirmed)
        if len(self._watched) > _MOST_WATCHED:
            self._unwatch(next(iter(self._watched)))

    def _unwatch(self, seq: int) -> None:
        del self._watched[seq]
        self._node.watch.end(seq)

    def take(self, told: list[Told], now_ns: int) -> list[tuple[Application, Status]]:
        """The statuses to report now. `told` is the news of the sender; both lists of news are emptied."""
        if self._node.watch.news:
            for news in self._node.watch.news:
                self._packet_fate(news)
            self._node.watch.news.clear()
        for number, outcome, targets, last in told:
            owner = self._owners.get(number)
            if owner is None:
                continue
            fate = _OUTCOMES.get(outcome, Fate.EXPIRED)
            self.tell(owner, Status(number, fate, now_ns, nodes=targets, last=last))
            if last:
                del self._owners[number]
        told.clear()
        found = list(self.waiting)
        self.waiting.clear()
        return found

    def _packet_fate(self, news: PacketNews) -> None:
        seq, t_ns, reason = news
        watched = self._watched.get(seq)
        if watched is None:
            return
        application, handle, first, confirmed = watched
        if isinstance(reason, RadioStage):
            # a confirmed message without an owner is finished, and no application waits for its status
            if first and (not confirmed or handle in self._owners):
                self.tell(application, Status(handle, _STAGES[reason], t_ns))
            return
        self._unwatch(seq)
        if confirmed:
            return  # it will be sent again
        fate = _REASONS.get(reason, Fate.DROPPED)
        deadline_s = self._node.scenario.traffic.deadline_s
        refused = fate is Fate.REFUSED and deadline_s is not None and self._node.bounds(PRIORITY_BULK)
        interval_ns = self._node.least_interval_ns(seconds_to_ns(deadline_s or 0)) if refused else None
        self.tell(application, Status(handle, fate, t_ns, reason, last=True, interval_ns=interval_ns))
