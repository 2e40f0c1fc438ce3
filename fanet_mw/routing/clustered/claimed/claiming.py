"""The way of a node to turns of its own: it listens, claims a slot free within two hops, and draws for spare turns.

Its hellos say what it claims and what its neighbors claim (`slot_claims.py`); turns that no node within two hops claims
go by hash to the node with most to send (`own_turns.py`). What the hellos say decides the relays too: a connected
dominating set, which each node finds for itself, among the nodes that hold a slot.
"""

from collections import deque
from collections.abc import Mapping
from enum import Enum
from math import ceil
from typing import Final

from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import LIFETIME_HELLOS
from fanet_mw.routing.clustered.claimed.own_turns import OwnTurns, Share, draws
from fanet_mw.routing.clustered.claimed.slot_claims import SlotClaim, SlotClaims, SlotHello
from fanet_mw.routing.clustered.relaying.neighborhood import Neighborhood
from fanet_mw.routing.clustered.tdma.turns import Turns, turn_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S, seconds_to_ns
from fanet_mw.wire.claims import MOST_LOTS, Claims, SlotStatus

LISTEN_HELLOS: Final = 3
"""The number of hello intervals before the first claim: the two hops around are known after two if no hello is lost."""
_LONGEST: Final = 128
"""The number of slots of the longest superframe; in a larger crowd some nodes find no slot."""
_SAID: Final = 3
"""The number of hellos after which all nodes within two hops know how many lots a node has."""
IDLE: Final = 0.25
"""A node that needs less than this share of its claimed turns draws no lots."""
_LEAST_FRAME: Final = 256


class Change(Enum):
    """What became of a node's slot since its last hello."""

    NONE = "as before"
    WON = "it has a slot now"
    LOST = "it has none any more"


class ClaimedLoad:
    """The number of lots that a node wants, by what it had to send against the turns of its claim."""

    def __init__(self, now_ns: int) -> None:
        self._pushed = 0
        self._since_ns = now_ns
        self._said: deque[int] = deque([0] * _SAID, maxlen=_SAID)

    def push(self) -> None:
        self._pushed += 1

    def lots(self, *, waiting: int, turns_per_s: float, now_ns: int) -> int:
        """The number of lots to state in the next hello; asked once per hello."""
        turns = turns_per_s * (now_ns - self._since_ns) / S
        wanted = (self._pushed + waiting) / turns if turns > 0 else 0.0
        self._pushed, self._since_ns = 0, now_ns
        self._said.append(0 if wanted < IDLE else min(MOST_LOTS, ceil(2 * wanted)))
        return self._said[-1]

    def drawn(self) -> int:
        """The number of lots to draw with: no more than any node believes this one to have."""
        return min(self._said)


class Claiming:
    """The turns of one node, and what it knows of those of others."""

    def __init__(self, port: Port, own: OwnTurns) -> None:
        self._port = port
        self._hello_ns = seconds_to_ns(port.scenario.routing.hello_interval_s)
        self.own = own
        self.near = Neighborhood(
            port.node, lifetime_ns=self._lifetime_ns, rank=lambda _, standing: _rank(standing.slot)
        )
        self._longest = longest_superframe(own.turns)
        self._load = ClaimedLoad(0)
        self._claims = self._new_claims(0)
        self._known_ns = 0
        self._claimed_ns: int | None = None
        """The instant at which the node's claim last changed."""
        self._news = False
        """True if a hello has brought news that the node has not drawn with yet."""

    @property
    def _lifetime_ns(self) -> int:
        """The time after its last hello at which a neighbor, and its claim, is forgotten."""
        return int(LIFETIME_HELLOS * self._hello_ns)

    def _new_claims(self, now_ns: int) -> SlotClaims:
        slots = self._port.scenario.clusters.slots
        return SlotClaims(
            self._port.node,
            now_ns=now_ns,
            listen_ns=LISTEN_HELLOS * self._hello_ns,
            lifetime_ns=self._lifetime_ns,
            slots=slots or None,
            sized_to=None if slots else self._longest,
        )

    def start(self, now_ns: int) -> None:
        """The node is up; it listens."""
        self._claims = self._new_claims(now_ns)
        self._load = ClaimedLoad(now_ns)
        self._known_ns = now_ns + LISTEN_HELLOS * self._hello_ns

    # --- once per hello -------------------------------------------------------------------------------------------

    def settle(self, now_ns: int) -> Change:
        """Settle the node's claim; what `standing` states then holds until the next hello."""
        claim = self._claims.step(now_ns).own
        before, length = self.own.share, self._port.scenario.clusters.slots or claim.length
        self.own.share = None if claim.slot is None else Share(claim.slot, length)
        if self.own.share != before:
            self._claimed_ns = now_ns
        if (before is None) == (self.own.share is None):
            return Change.NONE
        return Change.WON if before is None else Change.LOST

    def standing(self, *, waiting: int, now_ns: int) -> SlotStatus:
        """The statement of the node's next hello about its own slots, with so many packets waiting."""
        claim = self._claims.own
        turns_per_s = len(self.own.claimed()) * S / self.own.turns.period_ns
        lots = self._load.lots(waiting=waiting, turns_per_s=turns_per_s, now_ns=now_ns)
        self._news = True  # a neighbor may have fallen silent
        self.draw(now_ns)
        return SlotStatus(claim.slot, self._port.scenario.clusters.slots or claim.length, claim.crowd, lots)

    def on_claims(self, claims: Claims, *, now_ns: int) -> None:
        """Take in the claims that a neighbor's hello states."""
        heard = tuple(self.claim_of(h.node, h.standing) for h in claims.heard)
        self._claims.on_hello(SlotHello(self.claim_of(claims.node, claims.own), heard), now_ns=now_ns)
        self._news |= self.near.on_claims(claims, now_ns=now_ns)

    def claim_of(self, node: NodeId, standing: SlotStatus) -> SlotClaim:
        """The claim in the terms of `slot_claims`. What no superframe can hold is no claim: it came off the air."""
        slot, length = standing.slot, standing.length
        fixed = self._port.scenario.clusters.slots
        if fixed:
            return SlotClaim(node, slot if length == fixed else None)
        if length > self._longest or length & (length - 1):
            return SlotClaim(node, None, crowd=standing.crowd)
        return SlotClaim(node, slot, length=length, crowd=standing.crowd)

    # --- in between -----------------------------------------------------------------------------------------------

    def push(self) -> None:
        """Note that another packet waits for the node's turns."""
        self._load.push()

    def draw(self, now_ns: int) -> None:
        """Learn which turns no node claims now, and which nodes draw for them; only a node that draws needs it."""
        lots = self._load.drawn()
        if not lots:
            self.own.draws = None
        elif self._news or self.own.draws is None or self.own.draws.lots != lots:
            self._news = False
            said = self.near.standings(now_ns=now_ns)
            shares = ((n, None if s.slot is None or not s.length else Share(s.slot, s.length)) for n, s in said)
            self.own.draws = draws(self._port.node, lots, shares, ((n, s.lots) for n, s in said))

    def relays(self, now_ns: int) -> bool:
        """True if floods need this node as a relay."""
        if self.own.share is None:
            return False
        slot = self.own.share.slot
        return now_ns < self._known_ns or self.near.dominates(own_rank=_rank(slot), now_ns=now_ns)

    def report(self) -> Mapping[str, object]:
        """JSON-able state."""
        share = self.own.share
        return {
            "slot": None if share is None else share.slot,
            "superframe": None if share is None else share.length,
            "claimed_ms": None if self._claimed_ns is None else self._claimed_ns / MS,
            "clashes": self._claims.repairs,
            "lots": self._load.drawn(),
        }


def _rank(slot: int | None) -> float:
    """The rank of a neighbor: one that holds a slot is to relay rather than one that holds none."""
    return 0.0 if slot is None else 1.0


def turn_bytes(scenario: Scenario) -> int:
    """The largest frame that a turn must hold."""
    least = max(scenario.traffic.payload_bytes, _LEAST_FRAME)
    return max(least, scenario.radio.max_frame_bytes) if scenario.routing.aggregate else least


def longest_superframe(turns: Turns) -> int:
    """The number of slots of the longest superframe: a power of two that fits a period."""
    return 1 << (min(_LONGEST, max(1, turns.per_frame)).bit_length() - 1)


def geometry(scenario: Scenario, frame_bytes: int) -> Turns:
    """Periods in which every hello finds a window, from the swarm's beginning."""
    period_ns = min(scenario.clusters.period_ns, seconds_to_ns(scenario.routing.hello_interval_s) // 2)
    contention_ns = round(scenario.clusters.contention_ms * MS)
    turn = turn_ns(scenario, payload_bytes=frame_bytes)
    return Turns(0, period_ns, contention_ns, turn, max(0, period_ns - contention_ns) // turn)
