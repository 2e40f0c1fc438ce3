"""The parts of a hello, which each node broadcasts to its neighbors. The order is that in the hello.

MAVLink's position and velocity   `fanet_mw/mavlink.py`; every node says it
messages of a search              `fanet_mw/wire/`: survivors, bids, searched cells
FANET_BEACON                      `beacon.py`: cluster, role, leader, and the distance from a head
FANET_DIGEST                      `digest.py`: which recent packets the sender holds, so that others can repair
FANET_TIME                        `beacon.py`: when an earlier hello ended, in swarm time
"""

from typing import Final

PLAIN_BYTES: Final = 137
"""The length of a hello with its routing header, HEARTBEAT, GLOBAL_POSITION_INT and FANET_BEACON."""
