"""What one UAV floods about survivors: its verdicts, and estimates of those to whom it flies or whom it places best.

A UAV that makes a verdict (confirmed, refuted, inside a building, among people, or a person without a phone) floods it
three times, and hellos pass it on meanwhile. When a UAV does not seem to know a verdict, one in four of those that know
it floods it again. A UAV that hears a lost one again floods all verdicts that were not flooded just now.
"""

from typing import Final

from agents.mission.finding.identities import paired
from agents.mission.finding.known_survivors import KnownSurvivors, estimate_of
from agents.mission.finding.phone_localization import Estimate
from agents.mission.outbox import Outbox, OutgoingPacket
from fanet_mw.trace import Confirmed, PlacedAmong, PlacedInside, Refuted
from fanet_mw.units import MS, US, NodeId, S
from fanet_mw.wire.survivors import Found, Standing, Survivor, person_id

_TELLINGS: Final = 3
"""The number of times that a UAV floods a verdict of its own."""
_AGAIN_NS: Final = 7 * S
"""The time between two of these floods, and the least time between a verdict and its repetition for another UAV."""
_IMPROVEMENT: Final = 0.8
"""A UAV floods its estimate again when the standard deviation has decreased to at most this share."""
_USEFUL_M: Final = 60.0
"""An estimate with a greater standard deviation is flooded only to replace a wrong one."""
_WRONG_SIGMAS: Final = 2.0
"""The estimate that a UAV flooded last is wrong if its present one is more than so many standard deviations away."""
_PASSED_ON_NS: Final = 12 * S
"""How long hellos pass on a verdict."""
_POST_NS: Final = 5 * S
"""How long the post on the ground is taken to be in reach after it has sent a hello."""
_PASSED_ON: Final = 3
"""The greatest number of verdicts in one hello."""
_LATELY_NS: Final = 4 * S
"""A UAV that hears a lost one again does not flood verdicts that somebody has flooded within this time."""
_TURN_NS: Final = 150 * MS
_TURNS: Final = 6
"""It floods the others in its turn, one of so many of this length, by its id: what one has flooded the next ones do
not.
"""
_TELLERS: Final = 4
"""If a UAV does not seem to know of a verdict, one in this number of the UAVs that know it floods it again."""


class Announcing:
    """Decides what one UAV floods about survivors, and when."""

    def __init__(self, node: NodeId, survivors: KnownSurvivors, outbox: Outbox) -> None:
        self._node = node
        self._survivors, self._outbox = survivors, outbox
        self._persons = -1
        """The number of this UAV's latest find of a person. They count up at least as fast as seconds pass, so that a
        program that was started again begins above its earlier ones."""
        self._took_over: set[int] = set()
        """The finds in whose favor this UAV has given up a person."""
        self._told: dict[int, Estimate] = {}
        """The estimate of each survivor's place that this UAV flooded last."""
        self._tellings: dict[int, tuple[int, int]] = {}
        """For each survivor on whom this UAV has made a verdict: how often that is still flooded, and when next."""
        self._heard_ns: dict[int, int] = {}
        """The instant at which this UAV learned or made the verdict on each survivor, or was last reminded of it by a
        UAV that did not seem to know it."""
        self._post_ns: int | None = None
        """The instant at which the post on the ground was heard last."""
        self._told_post = 0
        """The number of hellos that had a verdict for the post; it says whose turn is next."""
        self._flooded_ns: dict[int, int] = {}
        """The instant at which somebody last flooded each verdict that this UAV knew already."""
        self._meets_ns: int | None = None
        """The instant from which this UAV floods all verdicts, because it has met somebody who was lost."""

    def on_returned(self, now_ns: int) -> None:
        """A UAV that was lost is heard again: it, and others with it, may not know what was found in the meantime."""
        if self._meets_ns is None:
            self._meets_ns = now_ns + self._node % _TURNS * _TURN_NS

    def repeated(self, found: Found, now_ns: int) -> None:
        """Somebody has flooded a verdict that is not new to this UAV; an outdated one does not count."""
        held = self._survivors.verdict(found.survivor)
        if held is not None and held.standing is found.standing:
            self._flooded_ns[found.survivor] = now_ns

    def on_post(self, now_ns: int) -> None:
        """The post on the ground is in reach, and may not know yet what was found while it was not."""
        self._post_ns = now_ns

    def confirm(self, survivor: int, now_ns: int) -> None:
        place = self._survivors.by_id[survivor].filter.estimate()
        assert place is not None, "who was seen has a place"
        found = Found(now_ns // US, survivor, *place, self._node, Standing.CONFIRMED)
        self._decide(found, Confirmed, now_ns)

    def refute(self, survivor: int, now_ns: int) -> None:
        mistaken = self._survivors.by_id[survivor].confirmed
        assert mistaken is not None, "only a confirmation is refuted"
        refuted = mistaken._replace(t_us=now_ns // US, node=self._node, standing=Standing.REFUTED)
        self._decide(refuted, Refuted, now_ns)

    def place_inside(self, survivor: int, place: Estimate, now_ns: int) -> None:
        self._decide(Found(now_ns // US, survivor, *place, self._node, Standing.INSIDE), PlacedInside, now_ns)

    def place_among(self, survivor: int, place: Estimate, now_ns: int) -> None:
        self._decide(Found(now_ns // US, survivor, *place, self._node, Standing.AMONG), PlacedAmong, now_ns)

    def report_person(self, place: Estimate, now_ns: int) -> None:
        """Somebody was seen who carries no phone that fits: flood that a person is there."""
        self._persons = max(self._persons + 1, now_ns // S)
        while (person := person_id(self._node, self._persons)) in self._survivors.persons:
            self._persons += 1
        self._decide(Found(now_ns // US, person, *place, self._node, Standing.CONFIRMED), Confirmed, now_ns)

    def give_up_doubles(self, now_ns: int, *, steady_m2: float) -> None:
        """Give up people who were also found by a UAV with a lower id; one find replaces one person for good."""
        people = self._survivors.person_places()
        own = {person: place for person, place in people.items() if self._survivors.persons[person].node == self._node}
        others = {
            person: place
            for person, place in people.items()
            if person < min(own, default=0) and person not in self._took_over
        }
        if not own or not others:
            return
        chosen = paired(list(own.values()), list(others.values()), steady_m2=steady_m2)
        for person, column in zip(own, chosen, strict=True):
            if column is not None:
                self._took_over.add(list(others)[column])
                given_up = self._survivors.persons[person]._replace(t_us=now_ns // US, standing=Standing.REFUTED)
                self._decide(given_up, Refuted, now_ns)

    def keep_person(self, survivor: int, now_ns: int, *, steady_m2: float) -> None:
        """A confirmation is about to be taken back: whoever was seen there is a person all the same."""
        mistaken = self._survivors.by_id[survivor].confirmed
        assert mistaken is not None, "only a confirmation is taken back"
        place, people = estimate_of(mistaken), list(self._survivors.person_places().values())
        if not people or paired([place], people, steady_m2=steady_m2) == [None]:
            self.report_person(place, now_ns)

    def _decide(
        self, verdict: Found, record: type[Confirmed | Refuted | PlacedAmong | PlacedInside], now_ns: int
    ) -> None:
        survivor, east_m, north_m = verdict.survivor, round(verdict.east_m, 2), round(verdict.north_m, 2)
        self._survivors.on_found(verdict, now_ns=now_ns)
        self._outbox.records.append(record(now_ns, self._node, survivor, east_m, north_m))
        self._tellings[survivor] = _TELLINGS, now_ns
        self.decided(survivor, now_ns)

    def decided(self, survivor: int, now_ns: int) -> None:
        """A verdict is new to this UAV, which has made it or received it."""
        self._heard_ns[survivor] = now_ns
        self._told.pop(survivor, None)

    def tell(self, task: int | None, now_ns: int) -> None:
        """Flood the verdicts that are due, the estimate of the survivor to whom this UAV flies, and those of others
        whose phones it has received, if its estimates are the best: a responder may look elsewhere.
        """
        if self._meets_ns is not None and now_ns >= self._meets_ns:
            self._meets_ns = None
            self._tell_all(now_ns)
        for survivor, (left, next_ns) in sorted(self._tellings.items()):
            if now_ns < next_ns:
                continue
            verdict = self._survivors.verdict(survivor)
            assert verdict is not None, "only a verdict is announced"
            self._flood(verdict)
            if left > 1:
                self._tellings[survivor] = left - 1, now_ns + _AGAIN_NS
            else:
                del self._tellings[survivor]
        if task is not None:
            self._tell_estimate(task, now_ns)
        for survivor in self._survivors.sought():
            if self._places_best(survivor):
                self._tell_estimate(survivor, now_ns)

    def _places_best(self, survivor: int) -> bool:
        """True if this UAV has received the phone of a survivor, and its estimate is the first, or clearly better than
        the one announced: another UAV may pass the survivor without knowing.
        """
        known = self._survivors.by_id[survivor]
        if self._node not in known.reporters:
            return False  # before its own estimate, which costs the most, is asked for
        own = known.own_place()
        if own is None or own.is_vague:
            return False
        return known.announced is None or own.sigma_m <= _IMPROVEMENT * estimate_of(known.announced).sigma_m

    def reported(self, report: Survivor, now_ns: int) -> None:
        """Another node reports a survivor, so it may not know yet that the survivor is confirmed."""
        if self._survivors.is_confirmed(report.survivor):
            self._remind(report.survivor, report.reporter, now_ns)

    def outdated(self, found: Found, now_ns: int) -> None:
        """Another node floods a confirmation that this UAV knows to be taken back."""
        self._remind(found.survivor, found.node, now_ns)

    def _remind(self, survivor: int, of_node: int, now_ns: int) -> None:
        """Flood a verdict again that `of_node` does not seem to know, unless that was done recently or others do it."""
        verdict = self._survivors.verdict(survivor)
        if verdict is None or now_ns - self._heard_ns.get(survivor, now_ns) <= _AGAIN_NS:
            return
        self._heard_ns[survivor] = now_ns
        if (of_node + self._node) % _TELLERS == 0:
            self._flood(verdict)

    def hello_frames(self, now_ns: int) -> bytes:
        """Recent verdicts for the next hello; while the post on the ground is in reach, also one of the others, each in
        its turn.
        """
        recent = [(t_ns, survivor) for survivor, t_ns in self._heard_ns.items() if now_ns - t_ns < _PASSED_ON_NS]
        chosen = [survivor for _, survivor in sorted(recent, reverse=True)[:_PASSED_ON]]
        if self._post_ns is not None and now_ns - self._post_ns < _POST_NS:
            del chosen[_PASSED_ON - 1 :]
            others = sorted(self._heard_ns.keys() - set(chosen))
            turn = self._told_post % max(1, len(others))
            chosen += [*others[turn:], *others[:turn]][: _PASSED_ON - len(chosen)]
            self._told_post += 1
        told = [self._survivors.verdict(survivor) for survivor in chosen]
        return b"".join(found.encode_frame(self._node) for found in told if found is not None)

    def _tell_all(self, now_ns: int) -> None:
        """Flood all verdicts but those that were flooded lately, the newest ones first."""
        for survivor in sorted(self._heard_ns, key=lambda one: (-self._heard_ns[one], one)):
            verdict = self._survivors.verdict(survivor)
            if verdict is not None and now_ns - self._flooded_ns.get(survivor, now_ns - S - _LATELY_NS) > _LATELY_NS:
                self._flooded_ns[survivor] = now_ns
                self._flood(verdict)

    def _tell_estimate(self, survivor: int, now_ns: int) -> None:
        """Flood this UAV's estimate of a survivor if it has become clearly better, or the one flooded last is wrong."""
        place, told = self._survivors.by_id[survivor].own_place(), self._told.get(survivor)
        if place is None or (told is None and place.sigma_m > _USEFUL_M):
            return
        if told is not None:
            better = place.sigma_m <= min(_IMPROVEMENT * told.sigma_m, _USEFUL_M)
            if not better and place.distance_m(told.at) <= _WRONG_SIGMAS * told.sigma_m:
                return
        self._told[survivor] = place
        self._flood(Found(now_ns // US, survivor, *place, self._node, Standing.ESTIMATED))

    def _flood(self, found: Found) -> None:
        self._outbox.packets.append(OutgoingPacket(found.encode_frame(self._node)))
