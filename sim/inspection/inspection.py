"""Everything that an inspector shows of a swarm: an observer that keeps what it is told, bounded."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from fanet_mw import tlog
from fanet_mw.bus.link_stats import LOSSES, LinkStats
from fanet_mw.bus.messages import Poses
from fanet_mw.errors import ConfigError, MalformedFrameError
from fanet_mw.foreign_file import open_regular
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Record
from fanet_mw.units import US, S
from fanet_mw.wire import node_of_system
from sim.inspection.messages import Messages
from sim.inspection.packets import Packets
from sim.observation.observer import Observer
from sim.observation.turns import Turns, turns
from sim.results.file_names import TLOG_FILE
from sim.results.run_folder import RunFolder

_LINKS_LAST_NS: Final = 2 * S
"""What links carried is told each second in which they carry anything."""


class LinkLine(NamedTuple):
    """What one link carried."""

    src: int
    dst: int
    copies: int
    received: int
    rssi_dbm: float | None
    lost: Mapping[str, int]

    def order(self) -> tuple[int, int, int]:
        return -self.copies, self.src, self.dst


class Inspection(Observer):
    """What was told of one swarm until now."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.messages = Messages()
        self.packets = Packets()
        self.links: Sequence[LinkLine] = ()
        """What links carried lately, or in the whole run of a recording, the busiest first."""
        self._links_ns = 0
        """When that was told last."""
        self.now_ns = 0
        self._reports: dict[int, Mapping[str, Any]] = {}

    def take_poses(self, poses: Poses) -> None:
        self.now_ns = max(self.now_ns, poses.t_ns)
        if poses.t_ns > self._links_ns + _LINKS_LAST_NS:
            self.links = ()

    def take_records(self, records: Iterable[Record]) -> None:
        self.packets.take(records)

    def take_links(self, stats: LinkStats) -> None:
        lines = [
            LinkLine(row.src, row.dst, row.copies, row.received, row.rssi_dbm, dict(zip(LOSSES, row.lost, strict=True)))
            for row in stats.rows()
        ]
        self.links, self._links_ns = sorted(lines, key=LinkLine.order), stats.t_ns

    def take_report(self, name: str, content: Mapping[str, Any], *, t_ns: int) -> None:
        if name.startswith("agent-"):
            self._reports[int(name.removeprefix("agent-"))] = content

    def take_tap(self, node: int, t_ns: int, data: bytes) -> None:
        self.now_ns = max(self.now_ns, t_ns)
        self.messages.take(node, "tap", t_ns, data)

    def take_frame(self, node: int, t_ns: int, frame: bytes) -> None:
        self.messages.take(node, "air", t_ns, frame)

    def turns(self) -> Turns | None:
        return turns(self.scenario, self._reports)


def of_folder(folder: RunFolder) -> Inspection:
    """What the folder of a run holds; a log of MAVLink that is cut off there is counted as malformed."""
    found = Inspection(folder.scenario)
    found.now_ns = round(folder.summary["simulated_s"] * S)
    epoch_ns = folder.summary.get("epoch_unix_ns", 0)
    try:
        with open_regular(folder.folder / TLOG_FILE, follow=False) as log:
            for t_us, frame in tlog.read_from(log, source=TLOG_FILE):
                node = node_of_system(frame[5], nodes=folder.scenario.node_count)
                found.take_tap(node, t_us * US - epoch_ns, frame)
    except MalformedFrameError:
        found.messages.malformed += 1
    except ConfigError:
        pass  # a run without telemetry has no such file
    found.take_records(folder.records())
    for node, report in folder.agents().items():
        found.take_report(f"agent-{node}", report, t_ns=0)
    lines = [LinkLine(**{name: row[name] for name in LinkLine._fields}) for row in folder.links()]
    found.links = sorted(lines, key=LinkLine.order)
    return found
