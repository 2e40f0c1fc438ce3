"""Worst-case delays: the paper's estimate, and bounds that hold. Pure functions of integer nanoseconds.

`paper` has the paper's equations (2)-(4) exactly as published, for comparison. `slot_service` is the service of one
slot per superframe, `turn_service` that of single turns. `arrivals` and `network_calculus` have the parts of network
calculus that bound the delay of a queue into which packets come in bursts. `timetable_flood` bounds the delay of
floods in a timetable; the bound that a node states from it is in `fanet_mw/routing/clustered/timetable/own_bound.py`.
`mac` has the constants of the MAC, and `guard_time` the guard time of a slot.
"""

from fanet_mw.bounds.arrivals import Arrivals, Periodic, Total
from fanet_mw.bounds.bounded_or_refused import Bounded, DelayBound, Refused
from fanet_mw.bounds.network_calculus import backlog, delay_any_order, delay_fifo
from fanet_mw.bounds.slot_service import Dcf, Server, SlotServer
from fanet_mw.bounds.turn_service import TurnServer

__all__ = [
    "Arrivals",
    "Bounded",
    "Dcf",
    "DelayBound",
    "Periodic",
    "Refused",
    "Server",
    "SlotServer",
    "Total",
    "TurnServer",
    "backlog",
    "delay_any_order",
    "delay_fifo",
]
