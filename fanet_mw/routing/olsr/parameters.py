"""The configuration of OLSR (RFC 3626, 18), the same as ns-3's."""

from typing import Final

from fanet_mw.units import S

HELLO_INTERVAL_NS: Final = 2 * S
REFRESH_INTERVAL_NS: Final = 2 * S
TC_INTERVAL_NS: Final = 5 * S
NEIGHB_HOLD_TIME_NS: Final = 3 * REFRESH_INTERVAL_NS
TOP_HOLD_TIME_NS: Final = 3 * TC_INTERVAL_NS
MAXJITTER_NS: Final = HELLO_INTERVAL_NS // 4

WILL_NEVER: Final = 0
WILL_LOW: Final = 1
WILL_DEFAULT: Final = 3
WILL_HIGH: Final = 6
WILL_ALWAYS: Final = 7
