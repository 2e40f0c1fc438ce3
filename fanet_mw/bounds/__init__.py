"""Worst-case delays: the paper's estimate, and bounds that hold. Pure functions of integer nanoseconds.

`paper` has the paper's equations (1)-(4), for comparison; `slot_service` and `turn_service` are services of slots, with
their guard time, and of turns, with the floods of a timetable; `arrivals` and `network_calculus` bound a queue.
"""

from fanet_mw.bounds.arrivals import Arrivals, Bounded, DelayBound, Periodic, Refused, Total
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
