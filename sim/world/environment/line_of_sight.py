"""Finds out which pairs of nodes have something solid between them, and what that costs their link.

Only pairs within the radio's reach are examined, and only if one end is below the highest obstacle. With
`radio.obstruction_loss_db = "knife_edge"` pairs count whose straight line passes near an edge, too.
Survivors' phones are not examined, because they can be received through walls.

What an edge costs: the loss of a radio link over or around the main edge between its ends, a single knife edge (ITU-R
P.526-15, 4.1).

    nu   h sqrt(2 / lambda (1 / d1 + 1 / d2));  h: height of the edge above the straight line, negative below it
    J    6.9 + 20 log10(sqrt((nu - 0.1)^2 + 1) + nu - 0.1)  [dB]  for nu > -0.78, else 0:  6 dB where it grazes

A hill's edge is the point of the ground with the greatest nu, if it rises above the straight line between the ground at
both ends. A building has three edges, its roof and its sides; the wave passes the one with the least nu. Of several
obstacles that with the greatest nu counts. Not modeled: several edges in a row, the ground between, rounded tops, and
waves through walls.
"""

import math
from array import array
from typing import Final

import numpy as np

from emulator.channel.propagation import gains_dbi, pairs_in_reach
from fanet_mw.bus.messages import Obstructions
from fanet_mw.scenario import Scenario
from fanet_mw.units import LIGHT_M_PER_S
from sim.world.arrays import Rows, Values
from sim.world.environment.solids import RAYS, Solids

_LEAST_NU: Final = -0.78
_NEAR_M: Final = 1.0
"""An edge is taken to be at least this far from both ends."""
_RISE_M: Final = 0.1
"""Ground that rises less above the straight line between the ground at both ends is no edge."""
FRESNEL_M: Final = 6.0
"""Obstacles farther from the straight line than this are taken to cost nothing, as at 2.4 GHz on links of up to 4 km,
in whose middle nu is -0.78 there.
"""


def knife_edge_db(nu: Values) -> Values:
    """J(nu), equation 31 of P.526-15."""
    off = np.maximum(nu, _LEAST_NU) - 0.1
    return np.asarray(np.where(nu > _LEAST_NU, 6.9 + 20 * np.log10(np.sqrt(off**2 + 1) + off), 0.0))


def loss_db(solids: Solids, first: Rows, second: Rows, *, wavelength_m: float) -> Values:
    """The loss between `first` and `second` [n, 3]; 0 where nothing is near the straight line."""
    way = second - first
    length = np.maximum(np.linalg.norm(way, axis=1), 2 * _NEAR_M)
    nu = np.full(len(first), -math.inf)
    for begin in range(0, len(first), RAYS):
        rows = slice(begin, begin + RAYS)
        line = _Line(first[rows], way[rows], length[rows], wavelength_m)
        nu[rows] = np.maximum(_of_hills(solids, line), _of_buildings(solids, line))
    return knife_edge_db(nu)


class _Line:
    """Straight lines between the ends of links."""

    def __init__(self, start: Rows, way: Rows, length: Values, wavelength_m: float) -> None:
        self.start = start
        self.way = way
        self.length = length
        self._wavelength_m = wavelength_m

    def nu(self, height_m: Values, along_m: Values, length_m: Values) -> Values:
        """The parameter of edges of some height above the lines, at some distance along them."""
        d1 = np.clip(along_m, _NEAR_M, length_m - _NEAR_M)
        return np.asarray(height_m * np.sqrt(2 / self._wavelength_m * (1 / d1 + 1 / (length_m - d1))))


def _of_hills(solids: Solids, line: _Line) -> Values:
    if not solids.hilly:
        return np.full(len(line.start), -math.inf)
    along, above = solids.above_hills(line.start, line.way / line.length[:, None], line.length)
    ground = line.start[:, 2:] + line.way[:, 2:] * (along / line.length[:, None]) - above
    share = along / line.length[:, None]
    chord = ground[:, :1] * (1 - share) + ground[:, -1:] * share
    nu = line.nu(-above, along, line.length[:, None])
    return np.asarray(np.where(ground - chord > _RISE_M, nu, -math.inf).max(axis=1))


def _of_buildings(solids: Solids, line: _Line) -> Values:
    """Each building by its corners, along each line and across it."""
    found = np.full(len(line.start), -math.inf)
    ray, corners, roof = solids.corners_near(line.start, line.way, margin_m=FRESNEL_M)
    if not len(ray):
        return found
    flat = np.linalg.norm(line.way[ray, :2], axis=1)
    unit = line.way[ray, :2] / np.maximum(flat, 1e-9)[:, None]
    off = corners - line.start[ray, None, :2]
    along = (off * unit[:, None]).sum(axis=2)
    across = off[..., 1] * unit[:, None, 0] - off[..., 0] * unit[:, None, 1]
    between = (along.max(axis=1) > 0) & (along.min(axis=1) < flat)
    each, length = np.arange(len(ray)), line.length[ray]
    steep = line.way[ray, 2] / np.maximum(flat, 1e-9)
    slant = length / np.maximum(flat, 1e-9)

    def past(height_m: Values, at: Values) -> Values:
        return line.nu(height_m, np.clip(at, 0.0, flat) * slant, length)

    def over(at: Values) -> Values:
        held = np.clip(at, 0.0, flat)
        return past(roof - (line.start[ray, 2] + steep * held), held)

    left, right = across.argmax(axis=1), across.argmin(axis=1)
    nu = np.minimum.reduce(
        [
            np.maximum(over(along.min(axis=1)), over(along.max(axis=1))),
            past(across[each, left], along[each, left]),
            past(-across[each, right], along[each, right]),
        ]
    )
    np.maximum.at(found, ray, np.where(between, nu, -math.inf))
    return found


class Sight:
    """The lines of sight between bodies."""

    def __init__(self, scenario: Scenario, solids: Solids) -> None:
        radio = self._radio = scenario.radio
        self._gains = gains_dbi(scenario)
        self._wavelength_m = LIGHT_M_PER_S / (radio.frequency_mhz * 1e6)
        self._knife_edges = radio.channel != "range" and radio.obstruction_loss_db == "knife_edge"
        self._solids = solids

    def obstructions(self, at: Rows, now_ns: int) -> Obstructions:
        """The pairs among nodes at `at` [nodes, 3] with something between them."""
        ground = array("f", self._solids.ground_m(at).tolist() if self._solids.hilly else ())
        found, _ = pairs_in_reach(at, self._radio, self._gains)
        found = found[found[:, 0] < found[:, 1]]
        top_m = self._solids.top_m + (FRESNEL_M if self._knife_edges else 0.0)
        found = found[np.minimum(at[found[:, 0], 2], at[found[:, 1], 2]) < top_m]
        losses = array("H")
        if len(found) and self._knife_edges:
            first, second = at[found[:, 0]], at[found[:, 1]]
            tenths = np.rint(10 * loss_db(self._solids, first, second, wavelength_m=self._wavelength_m)).astype(int)
            found, losses = found[tenths > 0], array("H", tenths[tenths > 0].tolist())
        elif len(found):
            found = found[self._solids.blocked(at[found[:, 0]], at[found[:, 1]])]
        return Obstructions(now_ns, array("H", (found + 1).ravel().tolist()), losses, ground)
