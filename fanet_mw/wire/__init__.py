"""The air format: one radio frame is a run of MAVLink 2 frames, the first of which is this package's routing header.

Any bytes decode to a value or to MalformedFrameError; values that no node of this project would send are malformed.
"""

from fanet_mw.wire.aggregation import bundle as bundle
from fanet_mw.wire.aggregation import unbundle as unbundle
from fanet_mw.wire.frame import *  # noqa: F403  (all of it but what begins with an underscore)
