"""How long to wait for a target's receipt: the retransmission timeout of RFC 6298, section 2."""

from typing import Final

from fanet_mw.units import MS, NodeId

_LEAST_WAIT_NS: Final = 300 * MS
"""The shortest wait, however soon earlier receipts came."""


class RetransmissionTimeout:
    """The mean time until the receipt of each target, and its variation, both smoothed."""

    def __init__(self, first_wait_ns: int) -> None:
        """`first_wait_ns`: how long to wait for a target of which no receipt has come yet."""
        self._first_wait_ns = first_wait_ns
        self._known: dict[NodeId, tuple[int, int]] = {}

    def expect(self, target: NodeId, takes_ns: int) -> None:
        """Use this time as if it had been measured, until one is."""
        self._known.setdefault(target, (takes_ns, takes_ns // 2))

    def measured(self, target: NodeId, took_ns: int) -> None:
        known = self._known.get(target)
        if known is None:
            self._known[target] = took_ns, took_ns // 2
            return
        smooth_ns, varies_ns = known
        varies_ns += (abs(smooth_ns - took_ns) - varies_ns) // 4
        self._known[target] = smooth_ns + (took_ns - smooth_ns) // 8, varies_ns

    def wait_ns(self, target: NodeId) -> int:
        known = self._known.get(target)
        return self._first_wait_ns if known is None else max(_LEAST_WAIT_NS, known[0] + 4 * known[1])
