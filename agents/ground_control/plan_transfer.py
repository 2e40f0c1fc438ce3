"""MAVLink's mission protocol at a vehicle: plans go up and down item by item, numbers in integers.

    COUNT -> REQUEST_INT 0 -> ITEM_INT 0 -> REQUEST_INT 1 ... -> ACK        up; a lost item is asked for again
    REQUEST_LIST -> COUNT; REQUEST_INT n -> ITEM_INT n                      down

One upload of each kind at a time: a second ground station is refused until the first has finished or fallen silent.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from agents.ground_control.plans import MOST_ITEMS, Item, Kind, RefusedError, item_of
from fanet_mw.mavlink import common
from fanet_mw.units import MS, earliest

_AGAIN_NS: Final = 1500 * MS
"""The time after which an item is asked for again: in band it may take a superframe for each way."""
_MOST_TIMES: Final = 5
_ALL: Final = common.MAV_MISSION_TYPE_ALL
_ACCEPTED: Final = common.MAV_MISSION_ACCEPTED


class Peer(NamedTuple):
    """Who asks: its system and component."""

    system: int
    component: int


@dataclass
class _Upload:
    """An upload under way."""

    peer: Peer
    count: int
    due_ns: int
    items: list[Item] = field(default_factory=list)
    times: int = 1


class PlanTransfer:
    """The plans on board, and the exchanges that change or read them."""

    def __init__(
        self,
        reply: Callable[[Any], None],
        *,
        check: Callable[[Kind, Item], None],
        accept: Callable[[Kind, list[Item]], None],
    ) -> None:
        """`check` and `accept` raise RefusedError for an item or a whole plan that cannot be flown."""
        self._reply, self._check, self._accept = reply, check, accept
        self.plans: dict[Kind, list[Item]] = {kind: [] for kind in Kind}
        self._uploads: dict[Kind, _Upload] = {}
        self._ended: dict[Kind, tuple[Peer, int, int]] = {}
        """Whose upload of each kind has ended since the last one began, the number of items that came, the result."""

    def next_due_ns(self) -> int | None:
        return earliest(*(upload.due_ns for upload in self._uploads.values()))

    def wake(self, now_ns: int) -> None:
        for kind, upload in [*self._uploads.items()]:
            if upload.due_ns > now_ns:
                continue
            upload.times += 1
            if upload.times > _MOST_TIMES:
                del self._uploads[kind]
                self._ack(upload.peer, kind, common.MAV_MISSION_OPERATION_CANCELLED)
            else:
                self._request(kind, upload, now_ns)

    def on_message(self, message: Any, peer: Peer, now_ns: int) -> bool:  # noqa: ANN401  (pymavlink has no types)
        """Take a message of the protocol; False for any other."""
        handle = self._HANDLERS.get(message.get_type())
        if handle is None:
            return False
        kind = message.mission_type
        if kind not in tuple(Kind) and not (kind == _ALL and message.get_type() == "MISSION_CLEAR_ALL"):
            self._ack(peer, kind, common.MAV_MISSION_UNSUPPORTED)
        else:
            handle(self, message, peer, now_ns)
        return True

    def _on_count(self, message: Any, peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        kind = Kind(message.mission_type)
        running = self._uploads.get(kind)
        if running is not None and running.peer != peer:
            self._ack(peer, kind, common.MAV_MISSION_DENIED)
        elif message.count > MOST_ITEMS:
            self._ack(peer, kind, common.MAV_MISSION_NO_SPACE)
        elif not message.count:
            self._uploads.pop(kind, None)
            self._finish(kind, [], peer)
        else:
            self._ended.pop(kind, None)
            upload = self._uploads[kind] = _Upload(peer, message.count, now_ns)
            self._request(kind, upload, now_ns)

    def _on_item(self, message: Any, peer: Peer, now_ns: int) -> None:  # noqa: ANN401
        kind = Kind(message.mission_type)
        upload = self._uploads.get(kind)
        if upload is None or upload.peer != peer:
            whose, count, result = self._ended.get(kind, (None, 0, 0))
            again = whose == peer and message.seq == count - 1  # the last item: its answer was lost
            self._ack(peer, kind, result if again else common.MAV_MISSION_INVALID_SEQUENCE)
            return
        if message.seq == len(upload.items):  # any other one was asked for twice
            try:
                item = item_of(message)
                self._check(kind, item)
            except RefusedError as refused:
                del self._uploads[kind]
                self._ended[kind] = peer, message.seq + 1, refused.result
                self._ack(peer, kind, refused.result)
                return
            upload.items.append(item)
            upload.times = 1
            if len(upload.items) == upload.count:
                del self._uploads[kind]
                self._finish(kind, upload.items, peer)
                return
        self._request(kind, upload, now_ns)

    def _finish(self, kind: Kind, items: list[Item], peer: Peer) -> None:
        result = _ACCEPTED
        try:
            self._accept(kind, items)
            self.plans[kind] = items
        except RefusedError as refused:
            result = refused.result
        self._ended[kind] = peer, len(items), result
        self._ack(peer, kind, result)

    def _on_list(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        kind = Kind(message.mission_type)
        self._reply(common.MAVLink_mission_count_message(*peer, len(self.plans[kind]), kind))

    def _on_request(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        kind, seq = Kind(message.mission_type), message.seq
        items = self.plans[kind]
        if seq >= len(items):
            self._ack(peer, kind, common.MAV_MISSION_INVALID_SEQUENCE)
            return
        item = items[seq]
        head = (*peer, seq, item.frame, item.command, 0, item.autocontinue, *item.params)
        if message.get_type() == "MISSION_REQUEST_INT":
            self._reply(common.MAVLink_mission_item_int_message(*head, item.x, item.y, item.z, kind))
        else:
            scale = 1.0 if item.frame == common.MAV_FRAME_MISSION else 1e7
            self._reply(common.MAVLink_mission_item_message(*head, item.x / scale, item.y / scale, item.z, kind))

    def _on_clear(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        for kind in Kind if message.mission_type == _ALL else (Kind(message.mission_type),):
            self._uploads.pop(kind, None)
            self._ended.pop(kind, None)
            self._accept(kind, [])
            self.plans[kind] = []
        self._ack(peer, message.mission_type, _ACCEPTED)

    def _on_part(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        """A plan goes as a whole: MAVLink has deprecated parts."""
        self._ack(peer, message.mission_type, common.MAV_MISSION_UNSUPPORTED)

    def _on_ack(self, message: Any, peer: Peer, _now_ns: int) -> None:  # noqa: ANN401
        """A ground station ends a download, or gives up its upload."""
        kind = Kind(message.mission_type)
        if message.type != _ACCEPTED and (upload := self._uploads.get(kind)) and upload.peer == peer:
            del self._uploads[kind]

    def _request(self, kind: Kind, upload: _Upload, now_ns: int) -> None:
        upload.due_ns = now_ns + _AGAIN_NS
        self._reply(common.MAVLink_mission_request_int_message(*upload.peer, len(upload.items), kind))

    def _ack(self, peer: Peer, kind: int, result: int) -> None:
        self._reply(common.MAVLink_mission_ack_message(*peer, result, kind))

    _HANDLERS: Final = {
        "MISSION_COUNT": _on_count,
        "MISSION_ITEM_INT": _on_item,
        "MISSION_ITEM": _on_item,
        "MISSION_REQUEST_LIST": _on_list,
        "MISSION_REQUEST_INT": _on_request,
        "MISSION_REQUEST": _on_request,
        "MISSION_CLEAR_ALL": _on_clear,
        "MISSION_ACK": _on_ack,
        "MISSION_WRITE_PARTIAL_LIST": _on_part,
        "MISSION_REQUEST_PARTIAL_LIST": _on_part,
    }
