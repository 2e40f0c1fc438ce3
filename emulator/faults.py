"""The faults in force on the air, and the planned ones. They change only links and noise.

    degraded   power x 10^(-loss_db / 10); below the sensitivity the link is gone; a share of what is received is lost
    jammed     the noise at receivers inside is higher, or nothing is received there; a jammer is sensed as energy from
               `radio.energy_detection_dbm` upwards: -62 dBm with OFDM (802.11-2020, 17.3.10.6), while DSSS looks for
               signals only (16.3.8.5, mode 2)
    cut        no power to or from the node; if it is only mute or deaf, in one direction
    partition  no power between stations on different sides

A link that would be audible is marked with the gravest of its faults, to which lost frames count. Frames in flight keep
the power with which they started. Not modeled: jammers that move or react.
"""

import heapq
import math
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from emulator.channel.link_budget import audible_mw, milliwatt, noise_mw
from emulator.channel.propagation import LinkTable
from emulator.kernel import state as s
from emulator.kernel.state import Reals
from fanet_mw.bus.radio_control import (
    EVERY,
    Control,
    Cut,
    Degrade,
    Fault,
    Jam,
    Mishap,
    Partition,
    Restore,
    can_end,
    extent_of,
    kind_of,
    wrong,
)
from fanet_mw.scenario import Radio
from fanet_mw.trace import RadioFault

MAX_FAULTS: Final = 1024
"""The greatest number of faults in force at the same time; further ones are refused."""


class _FaultInForce(NamedTuple):
    """A fault in force; `number` distinguishes it from an ended fault of the same label."""

    fault: Fault
    number: int


class Faults:
    """The faults in force that can end, by label, and the agenda of those that begin or end by themselves."""

    def __init__(self, radio: Radio, *, stations: int, uavs: int, planned: Iterable[tuple[int, Control]] = ()) -> None:
        """`uavs`: how many of the stations are UAVs, the first ones; what befalls UAVs befalls no others."""
        self._radio = radio
        self._stations, self._uavs = stations, uavs
        self._standing: dict[str, _FaultInForce] = {}
        self._number = 0
        self._agenda: list[tuple[int, int, Control | None, str, int]] = []
        """A heap of (instant, order, the fault that begins, or the label and number of the one that ends)."""
        for at_ns, control in planned:
            self._push(at_ns, control)
        self.records: list[RadioFault] = []

    def next_ns(self) -> int | None:
        """The instant at which the next fault begins or ends by itself; None if there is none."""
        return self._agenda[0][0] if self._agenda else None

    def pass_time(self, now_ns: int) -> list[str]:
        """Begin and end faults that are due by `now_ns`; returns for each refused one why it was refused."""
        refused = []
        while self._agenda and self._agenda[0][0] <= now_ns:
            at_ns, _, control, label, number = heapq.heappop(self._agenda)
            if control is not None:
                why = self.obey(control, at_ns)
                refused += [why] if why else []
            elif label in self._standing and self._standing[label].number == number:
                self._end(label, at_ns)
        return refused

    def obey(self, control: Control, now_ns: int) -> str | None:
        """Begin or end a fault now; returns why that was refused, or None."""
        if isinstance(control, Restore):
            if control.label and control.label not in self._standing:
                return "fault_unknown_label"
            for label in [control.label] if control.label else list(self._standing):
                self._end(label, now_ns)
            return None
        why = wrong(control, count=self._uavs if isinstance(control, Mishap) else self._stations)
        if why is None and len(self._standing) >= MAX_FAULTS and control.label not in self._standing:
            why = "fault_limit"
        if why is None:
            if control.label in self._standing:
                self._end(control.label, now_ns)
            self._begin(control, now_ns)
        return why

    def _begin(self, fault: Fault, now_ns: int) -> None:
        if can_end(fault):
            self._number += 1
            self._standing[fault.label] = _FaultInForce(fault, self._number)
            if fault.for_ns:
                self._push(now_ns + fault.for_ns, None, fault.label, self._number)
        self._note(fault, now_ns, active=True)

    def _end(self, label: str, now_ns: int) -> None:
        self._note(self._standing.pop(label).fault, now_ns, active=False)

    def _push(self, at_ns: int, control: Control | None, label: str = "", number: int = 0) -> None:
        heapq.heappush(self._agenda, (at_ns, self._number_of_entry(), control, label, number))

    def _number_of_entry(self) -> int:
        self._number += 1
        return self._number

    def _note(self, fault: Fault, now_ns: int, *, active: bool) -> None:
        node = fault.node if isinstance(fault, Cut | Mishap) else fault.src if isinstance(fault, Degrade) else 0
        other = fault.dst if isinstance(fault, Degrade) else 0
        self.records.append(RadioFault(now_ns, node, other, kind_of(fault), fault.label, active, extent_of(fault)))

    # --- the effect on links and noise ----------------------------------------------------------------------------

    def apply(self, links: LinkTable, at: Reals) -> tuple[Reals, Reals]:
        """Change links of stations at `at` [m, n x 3]; returns noise and jammers' energy [mW] at each."""
        noise, energy = np.full(self._stations, noise_mw(self._radio)), np.zeros(self._stations)
        faults = [item.fault for item in self._standing.values()]
        for fault in faults:
            if isinstance(fault, Degrade) and fault.src == EVERY:
                self._degrade_those(links, np.arange(links.count), fault)
            elif isinstance(fault, Degrade):
                self._degrade(links, fault.src - 1, fault.dst - 1, fault)
                if fault.both:
                    self._degrade(links, fault.dst - 1, fault.src - 1, fault)
        for fault in faults:
            if isinstance(fault, Jam):
                jamming = self._jam(links, at, fault)
                energy += jamming
                noise += np.where(np.isfinite(jamming), jamming, 0.0)
        for fault in faults:
            if isinstance(fault, Cut):
                self._cut(links, fault)
            elif isinstance(fault, Partition):
                self._part(links, at, fault)
        if faults:
            links.sort_dead_last()
        return noise, energy

    def _degrade(self, links: LinkTable, src: int, dst: int, fault: Degrade) -> None:
        """Degrade the link between two stations, if they are within reach of each other."""
        first, end = links.ptr[src], links.ptr[src + 1]
        self._degrade_those(links, first + np.flatnonzero(links.ints[s.LINK_DST, first:end] == dst), fault)

    def _degrade_those(self, links: LinkTable, chosen: npt.NDArray[np.intp], fault: Degrade) -> None:
        power_mw = links.reals[s.LINK_POWER, chosen] * milliwatt(-fault.loss_db)
        heard = links.ints[s.AUDIBLE, chosen] != 0
        audible = heard & ((fault.loss_db == 0) | (power_mw >= audible_mw(self._radio)))
        if self._radio.channel == "range":  # in this model any overlap destroys a frame
            power_mw[heard & ~audible] = 0.0
        links.reals[s.LINK_POWER, chosen] = power_mw
        links.ints[s.AUDIBLE, chosen] = audible
        links.ints[s.FAULT, chosen[heard]] = s.FATE_DEGRADED
        links.reals[s.SPARED, chosen[heard]] *= 1 - fault.loss_share

    def _jam(self, links: LinkTable, at: Reals, fault: Jam) -> Reals:
        """Mark the links into the jammed area; returns the power of the jammer at each station [mW]."""
        with np.errstate(invalid="ignore"):  # a station of unknown position is infinitely far away
            inside = np.hypot(at[:, 0] - fault.center.east, at[:, 1] - fault.center.north) <= fault.radius_m
        count = links.count
        hit = inside[links.ints[s.LINK_DST, :count]] & (links.ints[s.AUDIBLE, :count] == 1)
        links.ints[s.FAULT, :count][hit] = s.FATE_JAMMED
        if fault.noise_dbm == math.inf or self._radio.channel == "range":
            links.reals[s.SPARED, :count][hit] = 0.0
        return np.where(inside, milliwatt(fault.noise_dbm), 0.0)

    def _cut(self, links: LinkTable, fault: Cut) -> None:
        src, dst = (links.ints[row, : links.count] == fault.node - 1 for row in (s.LINK_SRC, s.LINK_DST))
        _silence(links, (src & (not fault.sends)) | (dst & (not fault.hears)))

    def _part(self, links: LinkTable, at: npt.NDArray[np.float64], fault: Partition) -> None:
        if fault.group:
            side = np.zeros(self._stations, bool)
            side[[node - 1 for node in fault.group]] = True
        else:
            east, north, other_east, other_north = fault.line_m
            with np.errstate(invalid="ignore"):  # a station of unknown position has no links
                cross = (other_east - east) * (at[:, 1] - north) - (other_north - north) * (at[:, 0] - east)
            side = cross > 0
        _silence(links, side[links.ints[s.LINK_SRC, : links.count]] != side[links.ints[s.LINK_DST, : links.count]])


def _silence(links: LinkTable, hit: npt.NDArray[np.bool_]) -> None:
    """Let no power pass over these links of the table."""
    count = links.count
    audible = hit & ((links.ints[s.AUDIBLE, :count] == 1) | (links.ints[s.FAULT, :count] != 0))
    links.ints[s.FAULT, :count][audible] = s.FATE_CUT
    links.ints[s.AUDIBLE, :count][hit] = 0
    links.reals[s.LINK_POWER, :count][hit] = 0.0
    links.reals[s.SPARED, :count][hit] = 0.0
