"""The air format: one radio frame is a run of MAVLink 2 frames, the first of which is this package's routing header.

The header (`frame.py`) and several packets in one frame (`aggregation.py`) are re-exported here. Each inner message has
a module of its own, and is coded by struct. Any bytes decode to a value or to MalformedFrameError; values that no node
of this project would send are malformed:

    `hello/`                            the parts of a hello: beacon and time beacon, digest
    `schedule.py`, `links.py`           a node asks for a place in a cluster, and reports the quality of its links; the
                                        leader's division into clusters
    `places.py`, `loads.py`             positions and loads of the nodes, for a timetable
    `rounds.py`                         who hears whom, and packets that are held, in turns of rounds
    `application_message.py`            messages of applications: pieces, targets, receipts
    `search_messages.py`                messages of a search; of these also `search_plan.py`, `survivors.py`
    `checks.py`                         what several decoders check
"""

from fanet_mw.wire.aggregation import bundle as bundle
from fanet_mw.wire.aggregation import unbundle as unbundle
from fanet_mw.wire.frame import *  # noqa: F403  (all of it but what begins with an underscore)
