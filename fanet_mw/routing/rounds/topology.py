"""Who hears whom in the whole swarm: each node states its neighbors, and all pass that on.

A statement bears the number of its epoch, a short interval of swarm time, so a newer one is known whoever passes it on.
A node states its neighbors when they change, once in an epoch at most, and once per second in any case. A link counts
if both its ends state it.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import reduce
from operator import or_
from typing import Final, NamedTuple

from fanet_mw.graph.topology import bits_of, dominates, nodes_of
from fanet_mw.units import NodeId, S
from fanet_mw.wire.rounds import HeardNodes

_MODULUS: Final = 256
"""On the air epochs are counted modulo this."""
_MISSED: Final = 2
"""A node of which more than so many statements have not come is taken to return from another part of the swarm. Its
next one goes ahead in a bulk slot, because the one that others still have may expire soon.
"""
_new: Final = tuple.__new__  # makes a `_Stated` faster, as is done once per statement


class _Stated(NamedTuple):
    """The newest known statement of a node."""

    epoch: int
    told: HeardNodes
    """What was stated, as it is passed on."""


class Topology:
    """The links of the swarm, as one node knows them. Sets of nodes are integers: bit i stands for node i + 1."""

    def __init__(self, node: NodeId, *, count: int, epoch_ns: int, lifetime_ns: int) -> None:
        self._node = node
        self._count = count
        self._epoch_ns = epoch_ns
        self._lifetime_epochs = min(_MODULUS // 2, -(-lifetime_ns // epoch_ns))
        """A statement that is older is forgotten."""
        self._refresh_epochs = max(1, S // epoch_ns)
        """A node repeats a statement that has not changed after so many epochs."""
        self._stated: dict[NodeId, _Stated] = {}
        self.links = [0] * (count + 1)
        """The nodes with which each node has links, by its id; the first entry is of no node."""
        self.news: dict[NodeId, None] = {}
        """The nodes whose statements are to be passed on, in the order in which these came."""
        self._hasty: dict[NodeId, None] = {}
        """Those of them whose statement is to go ahead in a bulk slot, as a change, or as the first for long."""
        self._oldest = 0
        """No known statement is of an earlier epoch than this one."""
        self.epoch_end_ns = 0
        """The instant at which this node states its neighbors next."""
        self._rings: list[int] = []
        """The nodes that are 0, 1, 2 and so on hops away."""
        self._hops: dict[NodeId, int] = {}
        """The hops to each node to which a way is known; empty until somebody asks."""
        self._dominates = True
        """Whether this node is in the dominating set."""
        self._dominates_for: Sequence[int] = ()
        """The links of this node and of its neighbors for which that was decided."""
        self._dominates_at = -1
        """The value of `_link_changes` at which these links were compared last."""
        self._unreached_ns: dict[NodeId, int] = {}
        """The instant since which each node without a way is known to have none."""
        self._reached_ns: dict[NodeId, int] = {}
        """The instant at which a way was found to each node that had none before."""
        self._known = 0
        """The nodes to which there has been a way."""
        self._grew_ns = 0
        """The latest instant at which a way to some node was found for the first time. Statements of nodes farther away
        may still be under way.
        """
        self._parted: Sequence[NodeId] = ()
        """What `parted` has returned last."""
        self._parted_for = (-1, 0)
        """The value of `_link_changes`, and the nodes left out, for which that was found."""
        self._rivals: list[tuple[NodeId, bool]] = []
        """What `rivals` has returned last."""
        self._rivals_for: tuple[int, int] | None = None
        """The neighbors, and the value of `changes`, for which that was found."""
        self._nearer: dict[NodeId, int] = {}
        """What `nearer` has returned for each destination."""
        self._nearer_for = -1
        """The value of `_link_changes` for which that was found."""
        self.changes = 0
        """How often statements have changed in whom a node hears, or in whether it takes part in bulk slots often."""
        self._link_changes = 0
        """How often a link has come or gone that both its ends have stated."""
        self._arranged_for = -1
        """The value of `_link_changes` for which the rings were computed."""

    # --- what is stated -------------------------------------------------------------------------------------------

    def state(self, heard: int, *, often: bool, now_ns: int) -> None:
        """State that this node hears these neighbors, and takes part in bulk slots often or not, if that is new or due
        again; forget what others have not repeated.
        """
        epoch = now_ns // self._epoch_ns
        self.epoch_end_ns = (epoch + 1) * self._epoch_ns
        if self._oldest < epoch - self._lifetime_epochs:
            for node in [n for n, one in self._stated.items() if one.epoch < epoch - self._lifetime_epochs]:
                self._forget(node)
            self._oldest = min((one.epoch for one in self._stated.values()), default=epoch)
        self._arrange(now_ns)
        known = self._stated.get(self._node)
        if known is None and not heard:
            return  # nobody would learn anything
        if (
            known is None
            or (known.told.heard, known.told.often) != (heard, often)
            or epoch - known.epoch >= self._refresh_epochs
        ):
            self._note(epoch, HeardNodes(self._node, epoch % _MODULUS, heard, often))

    def hear(self, told: Sequence[HeardNodes], *, now_ns: int) -> None:
        """A neighbor passes on what nodes have stated."""
        current = now_ns // self._epoch_ns
        stated = self._stated
        for one in told:
            node, short, heard, _ = one
            known = stated.get(node)
            if known is not None and known.told.epoch == short:
                continue
            behind = (current + 1 - short) % _MODULUS - 1  # one epoch ahead is possible, because clocks differ
            if node == self._node or node > self._count or behind > self._lifetime_epochs or heard >> self._count:
                continue
            if known is None or current - behind > known.epoch:
                self._note(current - behind, one)

    def _note(self, epoch: int, told: HeardNodes) -> None:
        node, _, heard, often = told
        known = self._stated.get(node)
        self._stated[node] = _new(_Stated, (epoch, told))
        self._oldest = min(self._oldest, epoch)
        self.news[node] = None
        changed = heard if known is None else heard ^ known.told.heard
        self.changes += changed != 0 or known is None or known.told.often != often
        if changed or known is None or epoch - known.epoch > _MISSED * self._refresh_epochs:
            self._hasty[node] = None
        if changed or known is None:
            self._relink(node, heard, changed)

    def _relink(self, node: NodeId, heard: int, changed: int) -> None:
        """A node states that it hears `heard` now; `changed`: those of whom it has stated something else before."""
        own, links = 1 << (node - 1), self.links
        before = links[node]
        for other in nodes_of(changed):
            stated = self._stated.get(other)
            if stated is not None and stated.told.heard & own and heard >> (other - 1) & 1:
                links[node] |= 1 << (other - 1)
                links[other] |= own
            else:
                links[node] &= ~(1 << (other - 1))
                links[other] &= ~own
        self._link_changes += links[node] != before

    def _forget(self, node: NodeId) -> None:
        self.changes += 1
        heard = self._stated.pop(node).told.heard
        self.news.pop(node, None)
        self._hasty.pop(node, None)
        self._relink(node, 0, heard)

    def take_news(self, most: int, *, ahead: bool = False) -> list[HeardNodes]:
        """At most so many statements to pass on, which are news no longer. `ahead` of the turn: changes alone, which
        stay news, because a frame in a bulk slot may be destroyed.
        """
        nodes = list(self._hasty if ahead else self.news)[:most]
        for node in nodes:
            self._hasty.pop(node, None)
            if not ahead:
                del self.news[node]
        return [self._stated[node].told for node in nodes]

    @property
    def has_changes(self) -> bool:
        """True while statements are to go ahead in a bulk slot."""
        return bool(self._hasty)

    def repeat(self) -> None:
        """Tell the neighbors once more what this node has stated; they do not pass it on."""
        if self._node in self._stated:
            self.news[self._node] = None

    def on_other_part(self, now_ns: int) -> None:
        """A node of another part is heard: it is told what all have stated, and the link to it is stated at once unless
        this node has stated something else in this epoch.
        """
        own = self._stated.get(self._node)
        if own is None or not own.told.heard:
            return  # as all at the start, when nobody knows yet whose slot it is
        self.news |= dict.fromkeys(self._stated)
        self._hasty |= dict.fromkeys(self._stated)
        if own.epoch < now_ns // self._epoch_ns:
            self.epoch_end_ns = now_ns

    # --- what follows from it -------------------------------------------------------------------------------------

    def _arrange(self, now_ns: int) -> None:
        """Compute the rings anew if something has changed."""
        if self._arranged_for == self._link_changes:
            return
        self._arranged_for = self._link_changes
        rings = list(self._rings_from(self._node))
        if rings == self._rings:
            return
        self._rings, self._hops = rings, {}
        reached = reduce(or_, self._rings)
        since, away = self._unreached_ns, nodes_of(~reached & (1 << self._count) - 1)
        self._unreached_ns = {node: since.get(node, now_ns) for node in away}
        self._reached_ns.update(dict.fromkeys(since.keys() - self._unreached_ns.keys(), now_ns))
        if reached & ~self._known:
            self._known |= reached
            self._grew_ns = now_ns

    def _rings_from(self, start: int, *, without: int = 0) -> Iterator[int]:
        """The nodes that are 0, 1, 2 and so on hops away from `start`, on ways that avoid those in `without`."""
        ring = reached = 1 << (start - 1)
        while ring:
            yield ring
            ring = self._around(ring) & ~(reached | without)
            reached |= ring

    def hops(self, now_ns: int) -> Mapping[NodeId, int]:
        """The hops to each node to which a way is known, this node included."""
        self._arrange(now_ns)
        if not self._hops:
            self._hops = {node: hops for hops, ring in enumerate(self._rings) for node in nodes_of(ring)}
        return self._hops

    def farthest(self, now_ns: int) -> int:
        self._arrange(now_ns)
        return len(self._rings) - 1

    def hops_to(self, node: NodeId, now_ns: int) -> int | None:
        """The hops to one node; None if no way is known."""
        return self.hops(now_ns).get(node)

    def reached_since_ns(self, node: NodeId) -> int:
        """The instant since which there is a way to a node that has one; 0 if there always was."""
        return self._reached_ns.get(node, 0)

    def nearer(self, destination: NodeId) -> int:
        """Nodes linked to this one that are fewer hops from a node; none if no way is known."""
        if self._nearer_for != self._link_changes:
            self._nearer_for, self._nearer = self._link_changes, {}
        found = self._nearer.get(destination)
        if found is None:
            found = self._nearer[destination] = self._toward(destination)
        return found

    def _toward(self, destination: NodeId) -> int:
        own = self.links[self._node]
        return next((ring & own for ring in self._rings_from(destination) if ring & own), 0)

    def _around(self, nodes: int) -> int:
        around = 0
        for node in nodes_of(nodes):
            around |= self.links[node]
        return around

    def reaches(self, node: NodeId, now_ns: int) -> bool:
        self._arrange(now_ns)
        return node not in self._unreached_ns

    def parted(self, now_ns: int, *, without: Collection[int] = ()) -> Sequence[NodeId]:
        """The nodes to which there was a way, and is none any more that avoids those in `without`; others may state a
        lost node as a neighbor for a while.
        """
        self._arrange(now_ns)
        passed = bits_of(without)
        if self._parted_for != (self._link_changes, passed):
            self._parted_for = self._link_changes, passed
            reached = reduce(or_, self._rings_from(self._node, without=passed))
            self._parted = nodes_of(self._known & ~reached)
        return self._parted

    def rivals(self, near: int) -> list[tuple[NodeId, bool]]:
        """The nodes within two hops, if this node hears `near`, and whether each takes part in bulk slots often, as one
        that has stated nothing is taken to.
        """
        if self._rivals_for != (near, self.changes):
            self._rivals_for = near, self.changes
            reached = near | self._around(near)
            stated = self._stated
            others = nodes_of(reached & ~(1 << (self._node - 1)))
            found = [(node, node not in stated or stated[node].told.often) for node in others]
            self._rivals = sorted(found, key=lambda rival: not rival[1])  # the likeliest owners of a slot come first
        return self._rivals

    def dominates(self) -> bool:
        """True if this node is one of the connected dominating set whose transmissions reach all nodes."""
        if self._dominates_at != self._link_changes:
            self._dominates_at = self._link_changes
            near = (self._node, *nodes_of(self.links[self._node]))
            links = [self.links[node] for node in near]
            if links != self._dominates_for:
                self._dominates_for = links
                self._dominates = dominates(self._node, dict(zip(near, links, strict=True)))
        return self._dominates

    def absent(self, now_ns: int, *, doubt_ns: int) -> Sequence[NodeId] | None:
        """The nodes to which no way leads. None while one of them has never been reached, and `doubt_ns` have not
        passed since the start and since a way to any node was found for the first time.
        """
        self._arrange(now_ns)
        unreached = self._unreached_ns
        if any(
            max(since, self._grew_ns) > now_ns - doubt_ns and not self._known >> (node - 1) & 1
            for node, since in unreached.items()
        ):
            return None
        return tuple(unreached)
