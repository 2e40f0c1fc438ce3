"""Virtual time: order, ties and determinism."""

import math

import pytest

from fanet_mw.actor import Actor
from fanet_mw.bus.messages import MavlinkTap, Message
from fanet_mw.errors import LocalProtocolError
from fanet_mw.hosts.virtual import VirtualHost, matches
from fanet_mw.units import MS


class Script(Actor):
    """Wakes at given instants and says so; logs all it hears."""

    def __init__(self, name: str, wakes_ns: list[int], *, hears: tuple[str, ...] = (), says: str = "t/x") -> None:
        super().__init__(name, hears)
        self._wakes_ns = sorted(wakes_ns)
        self._says = says
        self.log: list[tuple[int, str]] = []

    def start(self, now_ns: int) -> None:
        self.log.append((now_ns, "start"))

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        assert isinstance(message, MavlinkTap)
        self.log.append((now_ns, message.data.decode()))

    def wake(self, now_ns: int) -> None:
        self.log.append((now_ns, "wake"))
        self._wakes_ns = [t for t in self._wakes_ns if t > now_ns]
        self.outbox.append((self._says, MavlinkTap(now_ns, self.name.encode())))

    def next_wake_ns(self) -> int | None:
        return self._wakes_ns[0] if self._wakes_ns else None


def test_a_message_is_received_at_the_instant_it_is_put_and_before_time_moves_on() -> None:
    speaker = Script("speaker", [5 * MS])
    listener = Script("listener", [5 * MS], hears=("t/*",))
    host = VirtualHost([speaker, listener])
    host.start()
    host.run(10 * MS)
    assert listener.log == [(0, "start"), (5 * MS, "speaker"), (5 * MS, "wake"), (5 * MS, "listener")]


def test_ties_go_by_the_order_in_which_wakes_were_asked_for() -> None:
    ear = Script("ear", [], hears=("t/x",))
    host = VirtualHost([ear, *(Script(f"s{i}", [MS]) for i in range(5))])
    host.start()
    host.run(MS)
    assert [name for _, name in ear.log[1:]] == ["s0", "s1", "s2", "s3", "s4"]


def test_ties_go_by_that_order_over_several_runs_too() -> None:
    ear = Script("ear", [], hears=("t/x",))
    host = VirtualHost([ear, Script("second", [2 * MS, 10 * MS]), Script("first", [MS, 10 * MS])])
    host.start()
    for until_ns in (MS, 2 * MS, 10 * MS):
        host.run(until_ns)
    assert [name for t_ns, name in ear.log if t_ns == 10 * MS] == ["first", "second"]


def test_running_in_steps_is_running_at_once() -> None:
    def log(steps: list[int]) -> list[tuple[int, str]]:
        ear = Script("ear", [], hears=("t/*",))
        host = VirtualHost(
            [ear, Script("a", [k * 3 * MS for k in range(20)]), Script("b", [k * 2 * MS for k in range(30)])]
        )
        host.start()
        for until_ns in steps:
            host.run(until_ns)
        return ear.log

    assert log([60 * MS]) == log([k * MS for k in range(61)])


def test_a_wake_asked_for_in_the_past_comes_at_once() -> None:
    late = Script("late", [-7])
    host = VirtualHost([late])
    host.start()
    host.run(MS)
    assert late.log == [(0, "start"), (0, "wake")]


def test_an_actor_that_never_lets_time_move_is_named() -> None:
    class Stuck(Script):
        def next_wake_ns(self) -> int | None:
            return 0

    stuck = Stuck("culprit", [])
    host = VirtualHost([stuck])
    host.start()
    with pytest.raises(LocalProtocolError, match="culprit"):
        host.run(MS)
    assert 100_000 < len(stuck.log) < 200_000, "it is named soon, but many may act at one instant"


@pytest.mark.parametrize(
    ("expression", "topic", "covered"),
    [("a/*/c", "a/b/c", True), ("a/*/c", "a/b/b/c", False), ("a/b", "a/b", True), ("a/*", "a", False)],
)
def test_a_star_stands_for_exactly_one_chunk(expression: str, topic: str, covered: bool) -> None:
    assert matches(expression, topic) is covered


def test_actors_hear_in_their_order_and_then_listeners_whatever_their_expressions() -> None:
    order: list[str] = []

    class Noting(Script):
        def receive(self, topic: str, message: Message, now_ns: int) -> None:
            order.append(self.name)

    first, second = Noting("first", [], hears=("*/b/c",)), Noting("second", [], hears=("a/b/c", "a/*/c", "a/b/*"))
    others = [Noting(f"other {hears}", [], hears=(hears,)) for hears in ("a/b", "a/b/c/d", "a/*", "b/*/c", "*/*", "*")]
    host = VirtualHost(
        [*others, first, Script("speaker", [MS], says="a/b/c"), second],
        listeners=[("a/*/*", lambda *_: order.append("listener")), ("a/b/d", lambda *_: order.append("deaf"))],
    )
    host.start()
    host.run(MS)
    assert order == ["first", "second", "listener"]


class Sleeper(Script):
    """What it hears is when to wake instead [ms]; it is woken at no other instant."""

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        assert isinstance(message, MavlinkTap)
        self._wakes_ns = [int(message.data) * MS]


@pytest.mark.parametrize("wanted_ms", [7, 20])
def test_who_hears_something_wakes_when_it_then_wants_and_not_when_it_wanted_before(wanted_ms: int) -> None:
    speaker, sleeper = Script(str(wanted_ms), [5 * MS]), Sleeper("sleeper", [10 * MS], hears=("t/x",), says="t/y")
    host = VirtualHost([speaker, sleeper])
    host.start()
    host.run(100 * MS)
    assert sleeper.log == [(0, "start"), (wanted_ms * MS, "wake")]


class Again(Script):
    """Wants to be woken again at once, as if long ago, so many times at each of its instants."""

    def __init__(self, name: str, wakes_ns: list[int], *, times: int) -> None:
        super().__init__(name, wakes_ns)
        self._times = self._left = times

    def wake(self, now_ns: int) -> None:
        self._left -= 1
        if not self._left:
            super().wake(now_ns)
            self._left = self._times
        else:
            self.log.append((now_ns, "again"))

    def next_wake_ns(self) -> int | None:
        return super().next_wake_ns() if self._left == self._times else 1


def test_a_wake_up_in_the_past_comes_now_behind_those_asked_for_before() -> None:
    order: list[str] = []

    def noting(actor: Script) -> Script:
        wake = actor.wake

        def noted(now_ns: int) -> None:
            order.append(actor.name)
            wake(now_ns)

        actor.wake = noted  # type: ignore[method-assign]
        return actor

    host = VirtualHost([noting(Again("a", [5 * MS], times=2)), noting(Script("b", [5 * MS]))])
    host.start()
    host.run(10 * MS)
    assert order == ["a", "b", "a"]


def test_wake_ups_that_do_not_move_time_are_counted_at_one_instant_and_not_over_a_run() -> None:
    busy = Again("busy", [k * MS for k in range(1, 21)], times=6_000)
    host = VirtualHost([busy])
    host.start()
    host.run(30 * MS)
    assert len(busy.log) == 1 + 20 * 6_000


@pytest.mark.parametrize("wake_ns", [math.nan, math.inf, 1e9])
@pytest.mark.parametrize("at_start", [True, False])
def test_a_wake_up_at_no_instant_is_refused_before_it_breaks_the_order_of_others(
    wake_ns: float, *, at_start: bool
) -> None:
    class Odd(Script):
        def next_wake_ns(self) -> int | None:
            return wake_ns if at_start or len(self.log) > 1 else MS  # type: ignore[return-value]

    host = VirtualHost([Odd("odd", []), Script("other", [2 * MS])])

    def live() -> None:
        host.start()
        host.run(3 * MS)

    with pytest.raises(LocalProtocolError, match=r"odd: next_wake_ns\(\) = .* must be a whole number of ns"):
        live()


class Fragile(Script):
    """Raises when it hears something."""

    def receive(self, topic: str, message: Message, now_ns: int) -> None:
        raise ZeroDivisionError

    def stop(self, now_ns: int) -> None:
        raise ZeroDivisionError


def test_after_an_actor_has_raised_the_others_get_once_what_is_on_its_way_to_them_and_it_nothing() -> None:
    heard: list[tuple[str, Message]] = []
    ear = Script("ear", [], hears=("t/*",))
    broken = [Fragile(name, [9 * MS], hears=("t/x",)) for name in ("first", "second")]
    host = VirtualHost(
        [Script("early", [MS]), ear, *broken, Script("late", [MS])], listeners=[("t/*", lambda *it: heard.append(it))]
    )
    host.start()
    with pytest.raises(ZeroDivisionError):
        host.run(2 * MS)
    host.stop_after_failure()
    assert host.failed == ["first"]
    assert [name for _, name in ear.log[1:]] == ["early"], "late was not woken any more"
    assert host.now_ns == MS


def test_whoever_raises_at_the_end_too_is_left_out_then() -> None:
    puts = [Script("loud", []), Fragile("first", [], hears=("t/x",)), Fragile("second", [], hears=("t/x",))]
    ear = Script("ear", [], hears=("t/*",))
    host = VirtualHost([*puts, ear])
    host.start()
    with pytest.raises(ZeroDivisionError):
        host.put("t/x", MavlinkTap(0, b"one"))
    puts[0].outbox += [("t/x", MavlinkTap(0, b"two")), ("t/y", MavlinkTap(0, b"three"))]
    host.stop_after_failure()
    assert host.failed == ["first", "second"]
    assert [name for _, name in ear.log[1:]] == ["three"], "what was handed over is not handed over again"
