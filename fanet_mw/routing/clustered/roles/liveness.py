"""The last sign of life of each node: the newest packet that the node generated, whichever node relayed it.

A packet counts from the instant of its generation and not of its arrival, because it may have waited for a slot while
its origin failed. The memory is bounded by the number of nodes.
"""

from fanet_mw.units import NodeId


class Liveness:
    """The latest sign of life of each node."""

    def __init__(self) -> None:
        self._born_ns: dict[int, int] = {}

    def on_sign_of_life(self, node: int, *, born_ns: int) -> None:
        if born_ns > self._born_ns.get(node, -1):
            self._born_ns[node] = born_ns

    def last_ns(self, node: int) -> int | None:
        """The instant at which a node generated its newest packet received here; None if none was received."""
        return self._born_ns.get(node)

    def alive_below(self, node: int, *, since_ns: int) -> int:
        """The number of nodes with a lower id that have generated a packet since `since_ns`."""
        return sum(1 for other, born_ns in self._born_ns.items() if other < node and born_ns >= since_ns)

    def forget(self, node: NodeId) -> None:
        self._born_ns.pop(node, None)
