"""The configuration of AODV (RFC 3561, 10; numbers in parentheses are its sections); free choices are as in ns-3."""

from typing import Final

from fanet_mw.units import MS, S

ACTIVE_ROUTE_TIMEOUT_NS: Final = 3 * S
ALLOWED_HELLO_LOSS: Final = 2
HELLO_INTERVAL_NS: Final = 1 * S
NET_DIAMETER: Final = 35
NODE_TRAVERSAL_TIME_NS: Final = 40 * MS
NET_TRAVERSAL_TIME_NS: Final = 2 * NODE_TRAVERSAL_TIME_NS * NET_DIAMETER
RREQ_RETRIES: Final = 2
RREQ_RATELIMIT: Final = 10
"""The most RREQs that a node originates per second (6.3)."""
RERR_RATELIMIT: Final = 10
TTL_START: Final = 1
TTL_INCREMENT: Final = 2
TTL_THRESHOLD: Final = 7
TIMEOUT_BUFFER: Final = 2
PATH_DISCOVERY_TIME_NS: Final = 2 * NET_TRAVERSAL_TIME_NS
BLACKLIST_TIMEOUT_NS: Final = RREQ_RETRIES * NET_TRAVERSAL_TIME_NS
MY_ROUTE_TIMEOUT_NS: Final = 2 * max(PATH_DISCOVERY_TIME_NS, ACTIVE_ROUTE_TIMEOUT_NS)
"""The RFC has 2 * ACTIVE_ROUTE_TIMEOUT; here as in ns-3 it is the longer of that and 2 * PATH_DISCOVERY_TIME."""
DELETE_PERIOD_NS: Final = 5 * max(ACTIVE_ROUTE_TIMEOUT_NS, HELLO_INTERVAL_NS)
"""The factor K is 5 (10)."""
NEIGHBOR_LIFETIME_NS: Final = ALLOWED_HELLO_LOSS * HELLO_INTERVAL_NS
