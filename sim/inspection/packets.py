"""The way of each packet: who sent it, to whom it came over how many hops, and where it ended, from trace records."""

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from fanet_mw.trace import BoundExcludes, BoundStated, Delivered, Dropped, Generated, LetOut, Record
from fanet_mw.units import MS, S

MOST: Final = 5_000
"""The packets that are remembered; the oldest is forgotten."""


@dataclass
class Way:
    """One packet."""

    origin: int
    seq: int
    born_ns: int | None = None
    app: str = ""
    size: int = 0
    let_out_ns: int | None = None
    bound_ns: int | None = None
    excluded: list[int] = field(default_factory=list)
    """The nodes for which the bound does not hold."""
    delivered: list[tuple[int, int, int]] = field(default_factory=list)
    """(hops, delay [ns], node), as it came."""
    dropped: list[tuple[int, int, str]] = field(default_factory=list)
    """(instant, node, reason)."""

    def lines(self) -> list[str]:
        said = [f"packet {self.seq} of node {self.origin}"]
        if self.born_ns is not None:
            said[0] += f": {self.app}, {self.size} bytes, handed over at {self.born_ns / S:.3f} s"
            if self.let_out_ns is not None:
                said.append(f"  first frame announced {(self.let_out_ns - self.born_ns) / MS:.3f} ms later")
        if self.bound_ns is not None:
            but = f", but not at {', '.join(map(str, sorted(self.excluded)))}, gone" if self.excluded else ""
            said.append(f"  stated to arrive within {self.bound_ns / MS:.3f} ms{but}")
        hops: dict[int, list[tuple[int, int]]] = {}
        for hop, delay_ns, node in self.delivered:
            hops.setdefault(hop, []).append((delay_ns, node))
        for hop, came in sorted(hops.items()):
            nodes = ", ".join(f"{node} ({delay_ns / MS:.1f} ms)" for delay_ns, node in sorted(came)[:8])
            more = f" and {len(came) - 8} more" if len(came) > 8 else ""
            said.append(f"  hop {hop}: {nodes}{more}")
        said += [f"  ended in node {node} at {t_ns / S:.3f} s: {reason}" for t_ns, node, reason in self.dropped[:12]]
        if len(self.dropped) > 12:
            said.append(f"  and {len(self.dropped) - 12} more ends")
        if not self.delivered and not self.dropped:
            said.append("  not delivered to anybody")
        return said


class Packets:
    """The latest packets."""

    def __init__(self, most: int = MOST) -> None:
        self._most = most
        self.ways: OrderedDict[tuple[int, int], Way] = OrderedDict()
        self.forgotten = 0

    def take(self, records: Iterable[Record]) -> None:
        for record in records:
            match record:
                case Generated(t_ns, node, seq, app, size):
                    way = self._way(node, seq)
                    way.born_ns, way.app, way.size = t_ns, app, size
                case LetOut(t_ns, node, seq):
                    self._way(node, seq).let_out_ns = t_ns
                case BoundStated(_, node, seq, bound_ns):
                    self._way(node, seq).bound_ns = bound_ns
                case BoundExcludes(_, node, seq, other):
                    self._way(node, seq).excluded.append(other)
                case Delivered(_, node, origin, seq, delay_ns, hops):
                    self._way(origin, seq).delivered.append((hops, delay_ns, node))
                case Dropped(t_ns, node, reason, origin, seq):
                    if origin:
                        self._way(origin, seq).dropped.append((t_ns, node, reason))
                case _:
                    pass

    def _way(self, origin: int, seq: int) -> Way:
        way = self.ways.get((origin, seq))
        if way is None:
            way = self.ways[origin, seq] = Way(origin, seq)
            if len(self.ways) > self._most:
                self.ways.popitem(last=False)
                self.forgotten += 1
        return way
