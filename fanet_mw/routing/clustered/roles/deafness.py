"""A node that hears nobody says so in all that it sends (`FLAG_DEAF`): it is deaf, or alone.

    no frame for 4 hello intervals   -> what it sends is flagged; the first frame that it hears ends that
    who hears a flagged hello        -> reports the node, which keeps no timetable and relays nothing, to the leader

What is flagged is no sign of life and no objection, or a deaf node that goes on sending would be planned with for ever:
only applications use it.
"""

from fanet_mw.node.contract import Port
from fanet_mw.routing.clustered.roles.head_failure_detector import SILENT_HELLOS


class Deafness:
    """Whether one node hears anybody."""

    def __init__(self, port: Port, *, hello_ns: int) -> None:
        self._port = port
        self._silent_ns = int(SILENT_HELLOS * hello_ns)
        self._heard_ns = 0

    def on_frame(self, now_ns: int) -> None:
        self._heard_ns = now_ns
        self._port.deaf = False

    def review(self, now_ns: int) -> None:
        """A hello is due."""
        self._port.deaf = now_ns - self._heard_ns >= self._silent_ns
