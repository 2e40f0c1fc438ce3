"""Worst-case delay: the paper's estimate, and bounds that hold. Pure functions of integer nanoseconds.

`paper` holds the paper's equations (1)-(4) to the letter, for comparison. `slot` is the service of one slot per
superframe, `turn_gaps` that of single turns. `arrivals` and `network` are the parts of network calculus that bound a
queue fed by bursts; `tandem` joins several hops. `access` bounds the unicast from a source to its head, `guard` is the
guard time of a slot.
"""

from fanet_mw.bounds.access import ContendingTraffic, Dcf, access_bound
from fanet_mw.bounds.arrivals import Arrivals, Limited, Periodic, Total, token_bucket
from fanet_mw.bounds.delay_bound import Bounded, DelayBound, Refused
from fanet_mw.bounds.guard import guard_ns
from fanet_mw.bounds.network import backlog, delay_any_order, delay_fifo
from fanet_mw.bounds.slot import Server, SlotServer, single_slot_bound
from fanet_mw.bounds.tandem import Flow, Hop, ordered_tandem, path_bounds
from fanet_mw.bounds.turn_gaps import TurnServer

__all__ = [
    "Arrivals",
    "Bounded",
    "ContendingTraffic",
    "Dcf",
    "Flow",
    "Hop",
    "Limited",
    "DelayBound",
    "Periodic",
    "Refused",
    "Server",
    "SlotServer",
    "Total",
    "TurnServer",
    "access_bound",
    "backlog",
    "delay_any_order",
    "delay_fifo",
    "guard_ns",
    "ordered_tandem",
    "path_bounds",
    "single_slot_bound",
    "token_bucket",
]
