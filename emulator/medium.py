"""The link emulator as an actor: transmit requests and poses in, receptions and transmit statuses out.

It never looks into a frame, and a station is a node id minus one. Requests are announced ahead of time, and wait in the
kernel for their instant. What becomes of a request that comes after its instant is in `late_requests.py`.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from emulator.faults import Faults
from emulator.kernel import state as s
from emulator.kernel_interface import KernelInterface, Rows
from emulator.late_requests import LateRequests
from emulator.measurement import Measurement, Sample
from emulator.pcap import Capture
from emulator.requests import NUMBER_MASK, FrameSlots, RequestNumbers
from fanet_mw.actor import Actor
from fanet_mw.bus.messages import Message, Obstructions, Poses, Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.bus.radio_control import Cut, Degrade, Jam, Mishap, Partition, Restore
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import DropReason
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, FARTHEST_M, MS, NodeId, earliest

_REASON_OF: Final = {
    s.NO_RECEIVER: DropReason.NO_RECEIVER,
    s.COLLIDED: DropReason.COLLISION,
    s.DEAF: DropReason.HALF_DUPLEX,
    s.WEAK: DropReason.WEAK_SIGNAL,
    s.GIVEN_UP: DropReason.RETRY_LIMIT,
    s.NO_ROOM: DropReason.MAC_QUEUE_FULL,
    s.EXPIRED: DropReason.MAC_LIFETIME,
    s.DEGRADED: DropReason.DEGRADED,
    s.JAMMED: DropReason.JAMMED,
    s.CUT_OFF: DropReason.STATION_DOWN,
}


class MediumCounters:
    """The counters of requests by the medium, and those of copies by the kernel."""

    def __init__(self, *, time_scale: float) -> None:
        self.delivered = 0
        self.delivered_bytes = 0
        self.dropped: Counter[str] = Counter()
        self.refused: Counter[str] = Counter()
        """The number of hostile or misdirected inputs, by kind; none of them became a frame."""
        self.poses = 0
        self.controls = 0
        self.late = LateRequests(time_scale=time_scale)

    def drop(self, reason: DropReason) -> None:
        self.dropped[reason] += 1

    def lost(self, verdict: int) -> None:
        """Count a frame that no node has received, when nothing refers to it any more."""
        self.dropped[_REASON_OF[verdict]] += 1

    def copies(self, g: s.Ints, *, in_flight: int) -> dict[str, Any]:
        """The ledger at the receivers: copies transmitted in range, and how each ended but `in_flight` of them."""
        lost = {
            DropReason.COLLISION: int(g[s.COLLISION_COPIES]),
            DropReason.HALF_DUPLEX: int(g[s.HALF_DUPLEX_COPIES]),
            DropReason.WEAK_SIGNAL: int(g[s.WEAK_COPIES]),
            DropReason.DEGRADED: int(g[s.DEGRADED_COPIES]),
            DropReason.JAMMED: int(g[s.JAMMED_COPIES]),
            DropReason.STATION_DOWN: int(g[s.CUT_COPIES]),
        }
        return {
            "on_air": int(g[s.ON_AIR_COPIES]),
            "received": int(g[s.RECEIVED_COPIES]),
            "lost": {reason.value: count for reason, count in lost.items() if count},
            "in_flight": in_flight,
        }


ANNOUNCED: Final = 1024
"""The greatest number of a node's requests that may wait for their instant, in addition to those in its MAC queue."""
_new: Final = tuple.__new__
_RECEPTION, _FREE, _DELIVERED, _NEVER = s.OUT_RECEPTION, s.OUT_FREE, s.DELIVERED, s.NEVER
_OUTCOME_OF: Final[Mapping[DropReason, TxOutcome]] = {
    DropReason.BACKLOG: TxOutcome.QUEUE_FULL,
    DropReason.LATE: TxOutcome.LATE,
    DropReason.MALFORMED: TxOutcome.REFUSED,
    DropReason.TOO_LARGE: TxOutcome.REFUSED,
    DropReason.NO_RECEIVER: TxOutcome.REFUSED,
}
_NO_RECEPTION: Final = Reception(b"", NodeId(0), 0, 0.0)
"""The initial value of a variable that holds the latest reception while rows are read."""
_HORIZON_NS: Final = 60_000 * MS
"""A request further ahead than this is refused: no node plans so far ahead, and it would only occupy memory."""


class Medium(Actor):
    """The radio channel between the nodes of one swarm."""

    hears_out = True

    def __init__(self, scenario: Scenario, swarm: str, *, capture: Capture | None = None) -> None:
        topics = Topics(swarm)
        super().__init__("emulator", (topics.all_tx, topics.pose, topics.obstruction, topics.radio_control))
        radio, nodes = scenario.radio, [NodeId(node) for node in scenario.node_ids]
        self._topics = topics
        self._count = len(nodes)
        self._max_bytes = radio.max_frame_bytes
        self._handover_ns = radio.handover_ns
        self._close_ns = radio.lead_ns // 4
        self._rx_topics = [topics.radio_rx(node) for node in nodes]
        self._station_of = {topics.radio_tx(node): node - 1 for node in nodes}
        faults = Faults(radio, stations=self._count, uavs=scenario.nodes.count, planned=scenario.planned_faults)
        self._capture = capture
        self._kernel = KernelInterface(scenario, stations=self._count, faults=faults, capture=capture is not None)
        self._counters = MediumCounters(time_scale=scenario.time_scale)
        self._measurement = Measurement(scenario.traffic_window_ns, max_attempts=radio.max_attempts)
        self._numbers = RequestNumbers(self._count)
        self._slots = FrameSlots(self._kernel.slots(), nodes, most_held=radio.queue_frames + ANNOUNCED)
        self._due_ns = self._next_due_ns()
        self._now_ns = 0

    # --- the actor contract ---------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        self.wake(now_ns)
        self._kernel.link_counters.begin(now_ns)

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        if type(message) is TxRequest:
            station = self._station_of.get(topic)
            if station is None:
                self._counters.refused["unknown_station"] += 1
            else:
                self._request(station, message, now_ns)
        elif isinstance(message, Poses):
            self.wake(now_ns)
            self._place(message)
        elif isinstance(message, Obstructions):
            self._obstruct(message)
        elif topic == self._topics.radio_control and isinstance(
            message, Degrade | Jam | Cut | Partition | Mishap | Restore
        ):
            self.wake(now_ns)
            why = self._kernel.faults.obey(message, self._now_ns)
            self._counters.controls += why is None
            self._take_in_faults(why)
        else:
            self._counters.refused["message_type"] += 1

    def wake(self, now_ns: int) -> None:
        """Advance the air to `now_ns`, and send receptions and statuses."""
        while self._due_ns is not None and self._due_ns <= now_ns:
            self._pass_due(self._due_ns)
        rows = self._kernel.advance(now_ns)
        if rows:
            self._hand_out(rows)
        if now_ns > self._now_ns:
            self._now_ns = now_ns

    def next_wake_ns(self) -> int | None:
        wake_ns, due_ns = self._kernel.next_output_ns, self._due_ns
        if wake_ns == _NEVER:
            return due_ns
        if self._handover_ns:
            wake_ns = -(-wake_ns // self._handover_ns) * self._handover_ns
        return wake_ns if due_ns is None or wake_ns < due_ns else due_ns

    def stop(self, now_ns: int) -> None:
        self.wake(now_ns)
        self._report_links(self._now_ns)

    def report(self) -> Mapping[str, Any]:
        counters, arrays = self._counters, self._kernel.arrays
        return {
            "kind": "emulator",
            "frames": {
                "sent": self._numbers.total,
                "delivered": counters.delivered,
                "in_flight": self._slots.in_flight,
                "dropped": {reason: counters.dropped[reason] for reason in sorted(counters.dropped)},
            },
            "requests": self._numbers.report(),
            "copies": counters.copies(arrays.g, in_flight=self._kernel.copies_under_way()),
            "air": self._measurement.report(self._sample(), stations=self._count),
            "late": counters.late.report(self._numbers.total),
            "poses": counters.poses,
            "controls": counters.controls,
            "refused": dict(sorted(counters.refused.items())),
            "capture_failed": None if self._capture is None else self._capture.failure(),
            "handed": {i + 1: count for i, count in enumerate(arrays.st[s.HANDED].tolist()) if count},
        }

    # --- requests -------------------------------------------------------------------------------------------------

    def _request(self, station: int, request: TxRequest, now_ns: int) -> None:
        """Handle one request; whatever is wrong with it is counted and not raised."""
        seq, start_ns, frame, dst, wants_status, until_ns = request
        numbers, slots = self._numbers, self._slots
        if seq != numbers.expected[station] and (lost := numbers.lost_before(station, seq)):
            self._counters.dropped[DropReason.BUS] += lost
        numbers.expected[station] = (seq + 1) & NUMBER_MASK
        size = len(frame)
        if (dst != BROADCAST and not 1 <= dst <= self._count) or not 0 < size <= self._max_bytes:
            self._refuse_shape(station, request, now_ns)
            return
        if not now_ns <= start_ns < now_ns + _HORIZON_NS:
            if self._refuse_instant(station, request, now_ns):
                return
            start_ns = now_ns
        elif start_ns < now_ns + self._close_ns:
            self._counters.late.close += 1
        if slots.held[station] >= slots.most_held:
            self._refuse(station, request, DropReason.BACKLOG, now_ns)
            return
        if not slots.free:
            self._kernel.grow()
            slots.add(self._kernel.slots() - len(slots.requests))
        slot = slots.free.pop()
        slots.requests[slot], slots.sources[slot] = request, slots.nodes[station]
        slots.held[station] += 1
        if start_ns < self._now_ns:
            start_ns = self._now_ns
        to = s.EVERYONE if dst == BROADCAST else dst - 1
        self._kernel.submit(slot, station, to, size, start_ns, wants_status, until_ns)
        if self._kernel.link_counters.next_ns is None:
            self._kernel.link_counters.plan(self._now_ns)
            self._due_ns = self._next_due_ns()

    def _refuse_shape(self, station: int, request: TxRequest, now_ns: int) -> None:
        """Refuse a request whose destination does not exist, or whose frame is empty or too long."""
        size = len(request.frame)
        if request.dst != BROADCAST and not 1 <= request.dst <= self._count:
            reason = DropReason.NO_RECEIVER
        else:
            reason = DropReason.TOO_LARGE if size else DropReason.MALFORMED
        self._refuse(station, request, reason, now_ns)

    def _refuse_instant(self, station: int, request: TxRequest, now_ns: int) -> bool:
        """Refuse a request whose instant is absurd or too long ago (returns True); count a late one."""
        late_ns = now_ns - request.start_ns
        if not -_HORIZON_NS < late_ns < _HORIZON_NS:
            self._refuse(station, request, DropReason.MALFORMED, now_ns)
            return True
        too_late = self._counters.late.is_too_late(late_ns, now_ns=now_ns)
        if too_late:
            self._refuse(station, request, DropReason.LATE, now_ns)
        return too_late

    def _refuse(self, station: int, request: TxRequest, reason: DropReason, now_ns: int) -> None:
        self._counters.drop(reason)
        if request.wants_status:
            status = TxStatus(request.seq, _OUTCOME_OF[reason], now_ns, 0)
            self.outbox.append((self._rx_topics[station], status))

    # --- time -----------------------------------------------------------------------------------------------------

    def _pass_due(self, due_ns: int) -> None:
        """Process what is due at this instant: the measurement begins or ends, faults change, links are reported."""
        self._hand_out(self._kernel.advance(max(due_ns, self._now_ns)))
        self._now_ns = max(self._now_ns, due_ns)
        sample_ns = self._measurement.next_ns()
        if sample_ns is not None and sample_ns <= due_ns:
            self._measurement.pass_time(due_ns, self._sample())
        fault_ns = self._kernel.faults.next_ns()
        if fault_ns is not None and fault_ns <= due_ns:
            self._take_in_faults(*self._kernel.faults.pass_time(due_ns))
        links = self._kernel.link_counters
        if links.next_ns is not None and links.next_ns <= due_ns:
            if self._report_links(due_ns) or self._slots.in_flight:
                links.plan(due_ns)
            else:
                links.next_ns = None
        self._due_ns = self._next_due_ns()

    def _next_due_ns(self) -> int | None:
        return earliest(self._measurement.next_ns(), self._kernel.faults.next_ns(), self._kernel.link_counters.next_ns)

    def _sample(self) -> Sample:
        arrays, now_ns = self._kernel.arrays, self._now_ns
        return Sample(arrays.g.copy(), arrays.busy_ns(now_ns), self._counters.delivered_bytes, now_ns)

    def _report_links(self, now_ns: int) -> bool:
        stats = self._kernel.links(now_ns)
        if stats is not None:
            self.outbox.append((self._topics.radio_links, stats))
        return stats is not None

    def _take_in_faults(self, *refused: str | None) -> None:
        """Compute links and noise anew after faults have changed; count refused changes by their reasons."""
        for why in refused:
            if why is not None:
                self._counters.refused[why] += 1
        if self._kernel.faults.records:
            self.records += self._kernel.faults.records
            self._kernel.faults.records.clear()
            self._kernel.relink()
            self._due_ns = self._next_due_ns()

    def _hand_out(self, rows: Rows) -> None:
        if self._capture is not None:
            rows = self._record(rows, self._capture)
        counters, reception = self._counters, _NO_RECEPTION
        slots, append, rx_topics = self._slots, self.outbox.append, self._rx_topics
        requests, sources, held, free = slots.requests, slots.sources, slots.held, slots.free
        for kind, slot, station, t_ns, value, attempts in rows:
            request = requests[slot]
            assert request is not None, "the kernel speaks only of frames it was given"
            if kind == _RECEPTION:
                if not attempts:  # `_new` does what Reception(...) does in a third of the time
                    reception = _new(Reception, (request.frame, sources[slot], t_ns, value / 1000))
                append((rx_topics[station], reception))
            elif kind == _FREE:
                if value == _DELIVERED:
                    counters.delivered += 1
                    counters.delivered_bytes += len(request.frame)
                else:
                    counters.lost(value)
                requests[slot] = None
                held[station] -= 1
                free.append(slot)
            else:
                append((rx_topics[station], TxStatus(request.seq, TxOutcome(value), t_ns, attempts)))

    def _record(self, rows: Rows, capture: Capture) -> Rows:
        """Pass the rows that belong in a capture to it; returns the rows that are meant for nodes."""
        for kind, slot, station, t_ns, value, attempts in rows:
            request, node, src = self._slots.requests[slot], station + 1, self._slots.sources[slot]
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
        pairs = np.frombuffer(obstructions.pairs, np.uint16).astype(np.int64)
        if len(pairs) % 2 or (len(pairs) and not 1 <= pairs.min() <= pairs.max() <= self._count):
            self._counters.refused["obstructions"] += 1
            return
        losses_db = np.frombuffer(obstructions.losses_ddb, np.uint16) / 10
        if len(losses_db) not in (0, len(pairs) // 2):
            self._counters.refused["obstructions"] += 1
            return
        ground_m = np.frombuffer(obstructions.ground_m, np.float32).astype(np.float64)
        if len(ground_m) not in (0, self._count) or not (np.abs(ground_m) <= FARTHEST_M).all():
            self._counters.refused["obstructions"] += 1
            return
        self._kernel.obstruct(pairs.reshape(-1, 2) - 1, losses_db, ground_m if len(ground_m) else 0.0)

    def _place(self, poses: Poses) -> None:
        ids = np.frombuffer(poses.ids, np.uint16).astype(np.int64)
        if len(poses.states) != 6 * len(ids):
            self._counters.refused["poses"] += 1
            return
        states = np.frombuffer(poses.states, np.float64).reshape(-1, 6)
        known = (ids >= 1) & (ids <= self._count)
        sound = (np.abs(states[:, :3]) <= FARTHEST_M).all(axis=1)  # also false for NaN
        wrong = ids[known & ~sound] - 1
        if (known & sound).all():
            self._counters.poses += 1
        else:  # the sound rows count all the same
            self._counters.refused["poses"] += 1
        at, velocity = np.full((self._count, 3), np.inf), np.zeros((self._count, 3))
        at[wrong] = self._kernel.at[wrong]  # it stays where it was last known to be
        at[ids[known & sound] - 1] = states[known & sound, :3]
        velocity[ids[known & sound] - 1] = states[known & sound, 3:]
        self._kernel.place(at, velocity, poses.t_ns)
