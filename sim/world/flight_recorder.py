"""Remembers the last known flight of a swarm, from which a world that is started again continues.

Implausible poses are ignored, because it is better that a world starts from the beginning than not at all.
"""

import threading
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import Battery, Message, Poses, Setpoint
from fanet_mw.bus.topics import Topics, node_of
from fanet_mw.errors import MalformedFrameError
from fanet_mw.scenario import Scenario
from sim.world.arrays import Rows
from sim.world.mobility.guidance import makes_sense

_FARTHEST: Final = 1e6
"""The greatest coordinate [m] or velocity [m/s] that counts as plausible."""


class SwarmFlight(NamedTuple):
    """The state of all bodies, in the order of their ids, and their setpoints."""

    positions: Rows
    velocities: Rows
    setpoints: Mapping[int, Setpoint]
    """The last setpoint of each node that has had one."""
    charges: Mapping[int, float] = {}
    """The charge that each node's sensor told last."""


class FlightRecorder:
    """Receives the poses, setpoints and charges of a swarm, and keeps the newest."""

    def __init__(
        self, scenario: Scenario, subscribe: Callable[[str, Callable[[str, bytes], None]], None], names: Topics
    ) -> None:
        self._ids = list(scenario.uav_ids)
        self._all_ids = list(scenario.node_ids)
        self._lock = threading.Lock()  # the bus calls on threads of its own
        self._poses = b""
        self._setpoints: dict[int, bytes] = {}
        self._batteries: dict[int, bytes] = {}
        subscribe(names.pose, self._hear_poses)
        subscribe(names.all_setpoints, lambda topic, payload: self._hear(self._setpoints, topic, payload))
        subscribe(names.sensor("*", "battery"), lambda topic, payload: self._hear(self._batteries, topic, payload))

    def _hear_poses(self, _topic: str, payload: bytes) -> None:
        with self._lock:
            self._poses = payload

    def _hear(self, newest: dict[int, bytes], topic: str, payload: bytes) -> None:
        node = node_of(topic)
        if node in self._ids:
            with self._lock:
                newest[node] = payload

    def last(self) -> SwarmFlight | None:
        """The last known flight; None before the first poses, and if they do not belong to this swarm."""
        with self._lock:
            poses, setpoints, batteries = self._poses, dict(self._setpoints), dict(self._batteries)
        heard = [message for message in _decoded(poses) if isinstance(message, Poses)]
        if not heard or list(heard[-1].ids) != self._all_ids or len(heard[-1].states) != 6 * len(self._all_ids):
            return None
        states = np.array(heard[-1].states, dtype=np.float64).reshape(-1, 6)[: len(self._ids)]
        if not (np.abs(states) <= _FARTHEST).all():  # also false for NaN
            return None
        sent: dict[int, Setpoint] = {}
        for node in sorted(setpoints):
            for message in _decoded(setpoints[node]):
                if isinstance(message, Setpoint) and makes_sense(message):
                    sent[node] = message
        charges = {
            node: message.charge
            for node in sorted(batteries)
            for message in _decoded(batteries[node])
            if isinstance(message, Battery) and 0.0 <= message.charge <= 1.0
        }
        return SwarmFlight(states[:, :3].copy(), states[:, 3:].copy(), sent, charges)


def _decoded(payload: bytes) -> list[Message]:
    try:
        return codecs.decode(payload)
    except MalformedFrameError:
        return []
