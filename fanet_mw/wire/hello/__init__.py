"""The parts of a hello, which each node broadcasts to its neighbors."""

from typing import Final

PLAIN_BYTES: Final = 137
"""The length of a hello with its routing header, HEARTBEAT, GLOBAL_POSITION_INT and FANET_BEACON."""
