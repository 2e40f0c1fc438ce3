"""How a node comes to turns of its own: it listens, claims a slot that is free within two hops, and draws for others.

Its hellos state what it and its neighbors claim (`slot_claims.py`). Turns that nobody within two hops claims go to a
node that a hash chooses, more often to one that has more to send (`own_turns.py`). The same hellos decide which nodes
relay floods: a connected dominating set of nodes that hold a slot, which each node computes for itself.
"""

from collections import deque
from collections.abc import Mapping
from enum import Enum
from math import ceil
from typing import Final

from fanet_mw.node.contract import Port
from fanet_mw.node.neighbors import neighbor_lifetime_ns
from fanet_mw.routing.clustered.claimed.own_turns import OwnTurns, Share, draws
from fanet_mw.routing.clustered.claimed.slot_claims import SlotClaim, SlotClaims, SlotHello
from fanet_mw.routing.clustered.links.neighborhood import Neighborhood
from fanet_mw.routing.clustered.tdma.turn_timing import Turns, turn_ns
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, NodeId, S, seconds_to_ns
from fanet_mw.wire.hello.claims import MOST_LOTS, Claims, SlotStatus

LISTEN_HELLOS: Final = 3
"""The number of hello intervals for which a node listens before its first claim. All claims within two hops are known
after two of them if no hello is lost."""
_LONGEST: Final = 128
"""The number of slots of the longest superframe; with more nodes within two hops, some find no free slot."""
_HELLOS_UNTIL_KNOWN: Final = 3
"""The number of hellos after which all nodes within two hops know how many lots a node draws."""
IDLE: Final = 0.25
"""A node that uses less than this share of the turns of its claim draws no lots for further turns."""


class Change(Enum):
    """How the slot of a node has changed since its last hello."""

    NONE = "as before"
    WON = "it has a slot now"
    LOST = "it has none any more"


class ClaimedLoad:
    """The number of lots with which a node draws for unclaimed turns: more lots the more it has to send.

    The load is what the node had to send, compared with the turns of its claim.
    """

    def __init__(self, now_ns: int) -> None:
        self._pushed = 0
        self._since_ns = now_ns
        self._said: deque[int] = deque([0] * _HELLOS_UNTIL_KNOWN, maxlen=_HELLOS_UNTIL_KNOWN)

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
        """The number of lots to draw with, which no other node believes to be smaller."""
        return min(self._said)


class SlotAcquisition:
    """The claim of one node, and the claims of others as far as it knows them."""

    def __init__(self, port: Port, own: OwnTurns) -> None:
        self._port = port
        self._hello_ns = seconds_to_ns(port.scenario.routing.hello_interval_s)
        self._lifetime_ns = neighbor_lifetime_ns(port.scenario.routing.hello_interval_s)
        self.own = own
        self.near = Neighborhood(port.node, lifetime_ns=self._lifetime_ns, rank=lambda _, status: _rank(status.slot))
        self._longest = longest_superframe(own.turns)
        self._load = ClaimedLoad(0)
        self._claims = self._new_claims(0)
        self._known_ns = 0
        self._claimed_ns: int | None = None
        """The instant at which the node's claim last changed."""
        self._news = False
        """True if hellos have changed something since the node last drew for unclaimed turns."""

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
        """The node has started, and listens."""
        self._claims = self._new_claims(now_ns)
        self._load = ClaimedLoad(now_ns)
        self._known_ns = now_ns + LISTEN_HELLOS * self._hello_ns

    # --- once per hello -------------------------------------------------------------------------------------------

    def settle(self, now_ns: int) -> Change:
        """Make, keep or change the node's claim, which then holds until the next hello."""
        claim = self._claims.step(now_ns).own
        before, length = self.own.share, self._port.scenario.clusters.slots or claim.length
        self.own.share = None if claim.slot is None else Share(claim.slot, length)
        if self.own.share != before:
            self._claimed_ns = now_ns
        if (before is None) == (self.own.share is None):
            return Change.NONE
        return Change.WON if before is None else Change.LOST

    def slot_status(self, *, waiting: int, now_ns: int) -> SlotStatus:
        """What the node's next hello states about its own slot, while `waiting` packets wait for its turns."""
        claim = self._claims.own
        turns_per_s = len(self.own.claimed()) * S / self.own.turns.period_ns
        lots = self._load.lots(waiting=waiting, turns_per_s=turns_per_s, now_ns=now_ns)
        self._news = True  # a neighbor may have fallen silent
        self.draw(now_ns)
        return SlotStatus(claim.slot, self._port.scenario.clusters.slots or claim.length, claim.crowd, lots)

    def on_claims(self, claims: Claims, *, now_ns: int) -> None:
        """A neighbor's hello was received, with the claims that it states."""
        heard = tuple(self.claim_of(h.node, h.status) for h in claims.heard)
        self._claims.on_hello(SlotHello(self.claim_of(claims.node, claims.own), heard), now_ns=now_ns)
        self._news |= self.near.on_claims(claims, now_ns=now_ns)

    def claim_of(self, node: NodeId, status: SlotStatus) -> SlotClaim:
        """The claim that a received statement makes; none if it names a slot that no superframe can hold."""
        slot, length = status.slot, status.length
        fixed = self._port.scenario.clusters.slots
        if fixed:
            return SlotClaim(node, slot if length == fixed else None)
        if length > self._longest or length & (length - 1):
            return SlotClaim(node, None, crowd=status.crowd)
        return SlotClaim(node, slot, length=length, crowd=status.crowd)

    # --- in between -----------------------------------------------------------------------------------------------

    def push(self) -> None:
        """Count a packet that was queued for the node's turns."""
        self._load.push()

    def draw(self, now_ns: int) -> None:
        """Compute anew which turns nobody claims, and who draws for them; does nothing if this node draws no lots."""
        lots = self._load.drawn()
        if not lots:
            self.own.draws = None
        elif self._news or self.own.draws is None or self.own.draws.lots != lots:
            self._news = False
            said = self.near.slot_statuses(now_ns=now_ns)
            shares = ((n, None if s.slot is None or not s.length else Share(s.slot, s.length)) for n, s in said)
            self.own.draws = draws(self._port.node, lots, shares, ((n, s.lots) for n, s in said))

    def relays(self, now_ns: int) -> bool:
        """True if this node belongs to the relays of floods."""
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
            "turns": None if self._claimed_ns is None else self._turns_since(self._claimed_ns),
            "clashes": self._claims.repairs,
            "lots": self._load.drawn(),
        }

    def _turns_since(self, claimed_ns: int) -> Mapping[str, object]:
        """The geometry from the first whole superframe of the claim on, and the turns that the claim gives."""
        turns = self.own.turns
        start_ns = turns.superframe_start_ns(claimed_ns) + turns.period_ns
        return {**turns._replace(origin_ns=start_ns).report(), "own": list(self.own.claimed())}


def _rank(slot: int | None) -> float:
    """The rank of a neighbor as a relay: nodes that hold a slot come before nodes that hold none."""
    return 0.0 if slot is None else 1.0


def longest_superframe(turns: Turns) -> int:
    """The number of slots of the longest superframe: a power of two that fits a period."""
    return 1 << (min(_LONGEST, max(1, turns.per_superframe)).bit_length() - 1)


def geometry(scenario: Scenario) -> Turns:
    period_ns = scenario.claimed_period_ns
    contention_ns = round(scenario.clusters.contention_ms * MS)
    turn = turn_ns(scenario, payload_bytes=scenario.claimed_turn_bytes)
    return Turns(0, period_ns, contention_ns, turn, max(0, period_ns - contention_ns) // turn)
