"""The time to wait for the receipt of a target: the retransmission timeout of RFC 6298, section 2."""

from typing import Final

from fanet_mw.units import MS, NodeId

_LEAST_WAIT_NS: Final = 300 * MS
"""The least time to wait, however soon receipts have come so far."""


class RoundTrips:
    """The time until the receipt of each target, smoothed, and how much it varies."""

    def __init__(self, first_wait_ns: int) -> None:
        """`first_wait_ns` is the patience with a target of which no receipt has come."""
        self._first_wait_ns = first_wait_ns
        self._known: dict[NodeId, tuple[int, int]] = {}

    def measured(self, target: NodeId, took_ns: int) -> None:
        """Take in how long a receipt took."""
        known = self._known.get(target)
        if known is None:
            self._known[target] = took_ns, took_ns // 2
            return
        smooth_ns, varies_ns = known
        varies_ns += (abs(smooth_ns - took_ns) - varies_ns) // 4
        self._known[target] = smooth_ns + (took_ns - smooth_ns) // 8, varies_ns

    def wait_ns(self, target: NodeId) -> int:
        """The time to wait for the receipt of a target."""
        known = self._known.get(target)
        return self._first_wait_ns if known is None else max(_LEAST_WAIT_NS, known[0] + 4 * known[1])
