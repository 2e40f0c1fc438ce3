"""The link emulator as an actor: transmit requests and poses in, receptions and transmit statuses out.

Frames are only bytes here, and a station is a node id minus one. Requests are announced ahead and wait in the kernel
for their instant. A request that comes after its instant is counted, and dropped when it is over `TOO_LATE_NS` late.
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from emulator.accounts import Accounts
from emulator.air import Air, Rows
from emulator.faults import Faults
from emulator.kernel import state as s
from emulator.pcap import Capture
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Obstructions, Poses, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, NodeId, S, earliest

TOO_LATE_NS: Final = 50 * MS
"""A request later than this is dropped, because by then its slot belongs to another node."""
ANNOUNCED: Final = 1024
"""How many requests of one node may wait for their instant, beyond what its MAC queue holds."""
_new: Final = tuple.__new__
_RECEPTION, _FREE, _DELIVERED, _NEVER = s.OUT_RECEPTION, s.OUT_FREE, s.DELIVERED, s.NEVER
_NO_RECEPTION: Final = Reception(b"", NodeId(0), 0, 0.0)
_SEQ_MASK: Final = 0xFFFF_FFFF
_LONGEST_GAP: Final = 1 << 20
"""The greatest gap in request numbers that is taken for requests that were lost; a longer one is taken for nonsense."""
_FARTHEST_M: Final = 1e7
"""The greatest coordinate; larger ones would overflow the cells in which neighbors are looked for."""
_HORIZON_NS: Final = 60_000 * MS
"""A request further ahead than this is refused: no node plans so far, and the request would only occupy memory."""


class Medium(Actor):
    """The air between the nodes of one swarm."""

    hears_out = True

    def __init__(self, scenario: Scenario, swarm: str, *, capture: Capture | None = None) -> None:
        topics = Topics(swarm)
        super().__init__("emulator", (topics.all_tx, topics.pose, topics.obstruction, topics.radio_control))
        self._max_bytes = scenario.radio.max_frame_bytes
        self._count = scenario.nodes.count
        self._rx_topics = [topics.radio_rx(node) for node in scenario.node_ids]
        self._station_of = {topics.radio_tx(node): node - 1 for node in scenario.node_ids}
        self._faults = Faults(scenario.radio, stations=self._count, planned=scenario.planned_faults)
        self._capture = capture
        self._air = Air(scenario, stations=self._count, faults=self._faults, capture=capture is not None)
        self._accounts = Accounts()
        self._requests: list[TxRequest | None] = [None] * self._air.slots()
        self._ids = [NodeId(node) for node in scenario.node_ids]
        self._sources = [self._ids[0]] * self._air.slots()
        """The sender of the request in each slot."""
        self._free = list(range(self._air.slots() - 1, -1, -1))
        self._held = [0] * self._count
        """How many requests of each station have not ended."""
        self._most_held = scenario.radio.queue_frames + ANNOUNCED
        self._next_seq: list[int | None] = [None] * self._count
        self._requested = [0] * self._count
        """How many requests each node has made, including those that a gap in its numbers shows to be lost."""
        self._before = [0] * self._count
        """How many of them were made by the node before its process was restarted."""
        self._handover_ns = scenario.radio.handover_ns
        start_ns, end_ns = scenario.traffic_window_ns
        self._warm_ns: int | None = start_ns
        self._cool_ns: int | None = end_ns
        self._links_topic = topics.radio_links
        self._links_ns: int | None = None
        """The instant of the next report of links; None while the air is silent."""
        self._due_ns = self._next_due_ns()
        self._now_ns = 0
        self._control_topic = topics.radio_control

    # --- the actor contract ---------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self.wake(now_ns)
        self._air.book.begin(now_ns)

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if type(message) is TxRequest:
            station = self._station_of.get(topic)
            if station is None:
                self._accounts.refused["unknown_station"] += 1
            else:
                self._request(station, message, now_ns)
        elif isinstance(message, Poses):
            self.wake(now_ns)
            self._place(message)
        elif isinstance(message, Obstructions):
            self._obstruct(message)
        elif topic == self._control_topic and isinstance(message, Degrade | Jam | Cut | Restore):
            self.wake(now_ns)
            why = self._faults.obey(message, self._now_ns)
            self._accounts.controls += why is None
            self._take_in_faults(why)
        else:
            self._accounts.refused["message_type"] += 1

    def wake(self, now_ns: int) -> None:
        """Advance the air to `now_ns` and hand out what has resulted."""
        while self._due_ns is not None and self._due_ns <= now_ns:
            self._pass_due(self._due_ns)
        rows = self._air.advance(now_ns)
        if rows:
            self._hand_out(rows)
        if now_ns > self._now_ns:
            self._now_ns = now_ns

    def next_wake_ns(self) -> int | None:
        wake_ns, due_ns = self._air.next_output_ns, self._due_ns
        if wake_ns == _NEVER:
            return due_ns
        if self._handover_ns:
            wake_ns = -(-wake_ns // self._handover_ns) * self._handover_ns
        return wake_ns if due_ns is None or wake_ns < due_ns else due_ns

    def stop(self, now_ns: int) -> None:
        self.wake(now_ns)
        self._report_links(self._now_ns)

    def report(self) -> Mapping[str, Any]:
        accounts, g = self._accounts, self._air.g
        return {
            "kind": "emulator",
            "frames": {
                "sent": accounts.sent,
                "delivered": accounts.delivered,
                "in_flight": len(self._requests) - len(self._free),
                "dropped": {reason: accounts.dropped[reason] for reason in sorted(accounts.dropped)},
            },
            "requests": {
                str(node): {"all": count, "before_restart": self._before[node - 1]}
                for node, count in enumerate(self._requested, start=1)
            },
            "copies": accounts.copies(g),
            "air": accounts.air(g, busy_ns=self._air.busy_ns(self._now_ns), now_ns=self._now_ns, stations=self._count),
            "late": accounts.lateness(),
            "poses": accounts.poses,
            "controls": accounts.controls,
            "refused": dict(sorted(accounts.refused.items())),
            "handed": {i + 1: count for i, count in enumerate(self._air.st[s.HANDED].tolist()) if count},
        }

    # --- requests -------------------------------------------------------------------------------------------------

    def _request(self, station: int, request: TxRequest, now_ns: int) -> None:
        """Take in one request; what is wrong with a request is counted, never raised."""
        seq, start_ns, frame, dst, wants_status = request
        if seq != self._next_seq[station]:
            self._count_gap(station, seq)
        self._next_seq[station] = (seq + 1) & _SEQ_MASK
        self._accounts.sent += 1
        self._requested[station] += 1
        size = len(frame)
        if (dst != BROADCAST and not 1 <= dst <= self._count) or not 0 < size <= self._max_bytes:
            self._refuse_shape(station, request, now_ns)
            return
        if not now_ns <= start_ns < now_ns + _HORIZON_NS:
            if self._refuse_instant(station, request, now_ns):
                return
            start_ns = now_ns
        if self._held[station] >= self._most_held:
            self._refuse(station, request, DropReason.BACKLOG, now_ns)
            return
        self._held[station] += 1
        if not self._free:
            self._make_room()
        slot = self._free.pop()
        self._requests[slot] = request
        self._sources[slot] = self._ids[station]
        if start_ns < self._now_ns:
            start_ns = self._now_ns
        self._air.submit(slot, station, s.EVERYONE if dst == BROADCAST else dst - 1, size, start_ns, wants_status)
        if self._links_ns is None:
            self._links_ns = (self._now_ns // S + 1) * S
            self._due_ns = self._next_due_ns()

    def _refuse_shape(self, station: int, request: TxRequest, now_ns: int) -> None:
        """Refuse a request whose destination does not exist or whose frame is empty or too long."""
        size = len(request.frame)
        if request.dst != BROADCAST and not 1 <= request.dst <= self._count:
            reason = DropReason.NO_RECEIVER
        else:
            reason = DropReason.TOO_LARGE if size else DropReason.MALFORMED
        self._refuse(station, request, reason, now_ns)

    def _refuse_instant(self, station: int, request: TxRequest, now_ns: int) -> bool:
        """Refuse a request whose instant is absurd or too long past; a late one is counted. True if it was refused."""
        late_ns = now_ns - request.start_ns
        if not -_HORIZON_NS < late_ns < _HORIZON_NS:
            self._refuse(station, request, DropReason.MALFORMED, now_ns)
            return True
        self._accounts.late(late_ns)
        if late_ns > TOO_LATE_NS:
            self._refuse(station, request, DropReason.LATE, now_ns)
        return late_ns > TOO_LATE_NS

    def _count_gap(self, station: int, seq: int) -> None:
        """Count the requests that the bus lost, as a gap in their numbers shows: they were sent, and are dropped."""
        expected = self._next_seq[station]
        if expected is None:  # the emulator has restarted, or the first requests were lost: the run's ledger finds that
            return
        if seq == 0:  # the node has been restarted
            self._before[station] = self._requested[station]
            return
        gap = (seq - expected) & _SEQ_MASK
        if gap < _LONGEST_GAP:
            self._accounts.sent += gap
            self._accounts.dropped[DropReason.BUS] += gap
            self._requested[station] += gap

    def _refuse(self, station: int, request: TxRequest, reason: DropReason, now_ns: int) -> None:
        self._accounts.drop(reason)
        if request.wants_status:
            outcome = TxOutcome.QUEUE_FULL if reason is DropReason.BACKLOG else TxOutcome.LATE
            status = TxStatus(request.seq, outcome, now_ns, 0)
            self.outbox.append((self._rx_topics[station], status))

    def _make_room(self) -> None:
        before = self._air.slots()
        self._air.grow()
        self._requests += [None] * before
        self._sources += [self._ids[0]] * before
        self._free = list(range(2 * before - 1, before - 1, -1))

    # --- time -----------------------------------------------------------------------------------------------------

    def _pass_due(self, due_ns: int) -> None:
        """Process what falls due at this instant: measurement begins or ends, faults change, links are reported."""
        self._hand_out(self._air.advance(max(due_ns, self._now_ns)))
        self._now_ns = max(self._now_ns, due_ns)
        if self._warm_ns is not None and self._warm_ns <= due_ns:
            self._accounts.measure_from(self._air.g, busy_ns=self._air.busy_ns(self._now_ns), now_ns=self._now_ns)
            self._warm_ns = None
        if self._cool_ns is not None and self._cool_ns <= due_ns:
            self._accounts.measure_until(self._air.g, busy_ns=self._air.busy_ns(self._now_ns), now_ns=self._now_ns)
            self._cool_ns = None
        fault_ns = self._faults.next_ns()
        if fault_ns is not None and fault_ns <= due_ns:
            self._take_in_faults(*self._faults.pass_time(due_ns))
        if self._links_ns is not None and self._links_ns <= due_ns:
            silent = not self._report_links(due_ns) and len(self._free) == len(self._requests)
            self._links_ns = None if silent else (due_ns // S + 1) * S
        self._due_ns = self._next_due_ns()

    def _next_due_ns(self) -> int | None:
        return earliest(self._warm_ns, self._cool_ns, self._faults.next_ns(), self._links_ns)

    def _report_links(self, now_ns: int) -> bool:
        """Report what the links have carried; returns False when it was nothing."""
        stats = self._air.links(now_ns)
        if stats is not None:
            self.outbox.append((self._links_topic, stats))
        return stats is not None

    def _take_in_faults(self, *refused: str | None) -> None:
        """Take in changes of faults, and count each refused one by what was wrong with it."""
        for why in refused:
            if why is not None:
                self._accounts.refused[why] += 1
        if self._faults.records:
            self.records += self._faults.records
            self._faults.records.clear()
            self._air.relink()
            self._due_ns = self._next_due_ns()

    def _hand_out(self, rows: Rows) -> None:
        if self._capture is not None:
            rows = self._record(rows, self._capture)
        accounts, reception = self._accounts, _NO_RECEPTION
        append, requests, sources, rx_topics = self.outbox.append, self._requests, self._sources, self._rx_topics
        for kind, slot, station, t_ns, value, attempts in rows:
            request = requests[slot]
            assert request is not None, "the kernel speaks only of frames it was given"
            if kind == _RECEPTION:
                if not attempts:  # `_new` does what Reception(...) does in a third of the time
                    reception = _new(Reception, (request.frame, sources[slot], t_ns, value / 1000))
                append((rx_topics[station], reception))
            elif kind == _FREE:
                if value == _DELIVERED:
                    accounts.delivered += 1
                    accounts.delivered_bytes += len(request.frame)
                else:
                    accounts.lost(value)
                requests[slot] = None
                self._held[station] -= 1
                self._free.append(slot)
            else:
                append((rx_topics[station], TxStatus(request.seq, TxOutcome(value), t_ns, attempts)))

    def _record(self, rows: Rows, capture: Capture) -> Rows:
        """Pass the rows of a capture to it; returns the rows that are meant for nodes."""
        for kind, slot, station, t_ns, value, attempts in rows:
            request, node, src = self._requests[slot], station + 1, self._sources[slot]
            assert request is not None, "the kernel speaks only of frames it was given"
            if kind == s.OUT_START and value == s.DATA:
                capture.transmitted(t_ns, node, request.dst, request.seq, request.frame, attempts)
            elif kind == s.OUT_START:
                capture.acknowledged(t_ns, node, src)
            elif kind == s.OUT_RECEPTION:
                capture.received(t_ns, node, src, request.dst, request.seq, request.frame, value / 1000)
        return [row for row in rows if row[0] != s.OUT_START]

    # --- positions ------------------------------------------------------------------------------------------------

    def _obstruct(self, obstructions: Obstructions) -> None:
        """Take in what stands between nodes; it counts from the next poses on, which are of the same instant."""
        pairs = np.frombuffer(obstructions.pairs, np.uint16).astype(np.int64)
        if len(pairs) % 2 or (len(pairs) and not 1 <= pairs.min() <= pairs.max() <= self._count):
            self._accounts.refused["obstructions"] += 1
            return
        self._air.obstruct(pairs.reshape(-1, 2) - 1)

    def _place(self, poses: Poses) -> None:
        ids = np.frombuffer(poses.ids, np.uint16).astype(np.int64)
        if len(poses.states) != 6 * len(ids):
            self._accounts.refused["poses"] += 1
            return
        states = np.frombuffer(poses.states, np.float64).reshape(-1, 6)
        known = (ids >= 1) & (ids <= self._count)
        if not known.all() or not (np.abs(states[:, :3]) <= _FARTHEST_M).all():  # false for a NaN too
            self._accounts.refused["poses"] += 1
            return
        self._accounts.poses += 1
        at = np.full((self._count, 3), np.inf)
        at[ids - 1] = states[:, :3]
        self._air.place(at)
