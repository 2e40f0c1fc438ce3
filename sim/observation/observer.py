"""What an observer of a swarm is told, by whoever runs or hears it."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fanet_mw.bus.link_stats import LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.trace import Record


class Observer:
    """Someone who is told what can be seen and heard of a swarm, and changes nothing."""

    def take_poses(self, poses: Poses) -> None: ...

    def take_records(self, records: Iterable[Record]) -> None: ...

    def take_links(self, stats: LinkStats) -> None: ...

    def take_report(self, name: str, content: Mapping[str, Any], *, t_ns: int) -> None: ...

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None: ...


class Several(Observer):
    """Several observers, who are told in turn."""

    def __init__(self, observers: Sequence[Observer]) -> None:
        self._observers = observers

    def take_poses(self, poses: Poses) -> None:
        for one in self._observers:
            one.take_poses(poses)

    def take_records(self, records: Iterable[Record]) -> None:
        known = list(records)
        for one in self._observers:
            one.take_records(known)

    def take_links(self, stats: LinkStats) -> None:
        for one in self._observers:
            one.take_links(stats)

    def take_report(self, name: str, content: Mapping[str, Any], *, t_ns: int) -> None:
        for one in self._observers:
            one.take_report(name, content, t_ns=t_ns)

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None:
        for one in self._observers:
            one.take_tap(node, t_ns, data)
