"""Swarm instants out of unix time and a scale, and of a clock that slows down."""

import time
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import ClockEpoch, ClockState
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.hosts import clock as clock_module
from fanet_mw.hosts.clock import ClockKeeper, ClockListener, SwarmClock
from fanet_mw.hosts.timebase import Timebase
from fanet_mw.radios.field_bus import FieldBus
from fanet_mw.units import MS, NodeId, S


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_swarm_time_is_unix_time_since_the_epoch_times_the_scale(scale: float) -> None:
    clock = SwarmClock(ClockEpoch(time.time_ns() - 100 * S, scale, ClockState.RUNNING))
    assert clock.now_ns() / S == pytest.approx(100 * scale, abs=1)
    assert clock.wait_s(round((100 * scale + 30) * S)) == pytest.approx(30 / scale, abs=2)
    assert clock.wait_s(0) < 0, "it has passed"


@pytest.mark.parametrize("ahead_s", [-3000, 3000])
async def test_an_epoch_that_all_were_given_beforehand_may_be_far_and_is_nobodys_wrong_clock(
    ahead_s: int,
) -> None:
    field = FieldBus(Topics("field"), NodeId(1), inner=None, epoch_unix_ns=time.time_ns() + ahead_s * S)
    clock = await ClockListener(field, Topics("field")).running(timeout_s=5)
    assert clock.wait_s(0) == pytest.approx(ahead_s, abs=5)


class Machine:
    """Two machines with one time; the unix clock of the second began elsewhere on its monotonic clock."""

    def __init__(self) -> None:
        self.passed_ns = 0
        self.keepers = Timebase(lambda: 10**18 + self.passed_ns, lambda: 7 * S + self.passed_ns, 7)
        self.other = Timebase(lambda: 10**18 + self.passed_ns, lambda: 90 * S + self.passed_ns, 8)

    def let_pass(self, seconds: float) -> None:
        self.passed_ns += round(seconds * S)


class Silent:
    """A bus on which nobody listens."""

    def answer(self, _key: str, _content: Callable[[], bytes | None]) -> None: ...
    def watch(self, _expression: str, _on_change: Callable[[str, bool], None]) -> None: ...
    def put(self, _topic: str, _payload: bytes, *, reliable: bool = False) -> None: ...


async def started(machine: Machine, scale: float) -> tuple[ClockKeeper, ClockEpoch]:
    """A keeper whose clock is at swarm instant 0."""
    keeper = ClockKeeper(Silent(), Topics("slow"), time_scale=scale, expected=[], timebase=machine.keepers)  # type: ignore[arg-type]
    told = await keeper.start(timeout_s=1)
    machine.let_pass(0.3)
    return keeper, told


async def test_a_clock_slows_down_at_the_instant_that_it_has_reached() -> None:
    machine = Machine()
    keeper, told = await started(machine, 2.0)
    same, other = SwarmClock(told, machine.keepers), SwarmClock(told, machine.other)
    machine.let_pass(10)
    slower = keeper.pace(0.5)
    for clock in (same, other):
        clock.follow(slower)
        assert clock.now_ns() == 20 * S
    machine.let_pass(4)
    assert same.now_ns() == other.now_ns() == 22 * S
    assert same.wait_s(23 * S) == other.wait_s(23 * S) == 2.0
    assert SwarmClock(slower, machine.other).now_ns() == 22 * S, "a process that starts late"
    assert same.epoch_unix_ns == told.epoch_unix_ns, "what files count from stays"


async def test_a_process_that_hears_of_it_late_waits_for_the_others_and_does_not_go_back() -> None:
    machine = Machine()
    keeper, told = await started(machine, 1.0)
    late = SwarmClock(told, machine.keepers)
    machine.let_pass(10)
    slower = keeper.pace(0.5)
    machine.let_pass(0.2)
    late.follow(slower)
    assert late.now_ns() == 10 * S + 200 * MS, "the others are at 10.1 s"
    assert late.wait_s(10 * S + 300 * MS) == pytest.approx(0.4), "by the clock of the others"
    machine.let_pass(0.2)
    assert late.now_ns() == 10 * S + 200 * MS, "they have come so far"
    machine.let_pass(0.2)
    assert late.now_ns() == 10 * S + 300 * MS


async def test_an_older_word_of_the_keeper_changes_nothing() -> None:
    machine = Machine()
    keeper, told = await started(machine, 1.0)
    clock = SwarmClock(told, machine.keepers)
    machine.let_pass(10)
    first, second = keeper.pace(0.5), keeper.pace(0.25)
    for word in (second, first, told):
        clock.follow(word)
    machine.let_pass(8)
    assert clock.now_ns() == 12 * S


async def test_a_clock_speeds_up_at_the_instant_that_it_has_reached() -> None:
    machine = Machine()
    keeper, told = await started(machine, 0.5)
    same, late = SwarmClock(told, machine.keepers), SwarmClock(told, machine.other)
    machine.let_pass(10)
    faster = keeper.pace(2.0)
    assert same.follow(faster)
    assert same.now_ns() == 5 * S
    machine.let_pass(1)
    assert late.follow(faster)
    assert same.now_ns() == late.now_ns() == 7 * S
    assert not late.follow(faster), "it is no news"


async def test_an_early_end_reaches_the_clocks_and_moves_no_instant() -> None:
    machine = Machine()
    keeper, told = await started(machine, 0.5)
    clock = SwarmClock(told, machine.keepers)
    machine.let_pass(10)
    assert clock.ends_ns == 0
    assert clock.follow(keeper.end_at(7 * S))
    assert (clock.now_ns(), clock.ends_ns) == (5 * S, 7 * S)
    clock.follow(keeper.pace(1.0))
    assert clock.ends_ns == 7 * S, "another pace does not take it back"


@pytest.mark.parametrize("scale", [0.1, 2.0])
async def test_who_ends_early_is_told_ahead_by_real_time_and_never_beyond_the_end(
    monkeypatch: pytest.MonkeyPatch, scale: float
) -> None:
    monkeypatch.setattr(clock_module, "_NOTICE_S", 0.02)
    machine = Machine()
    keeper, told = await started(machine, scale)
    clock = SwarmClock(told, machine.keepers)
    machine.let_pass(10)
    now_ns = clock.now_ns()
    assert await keeper.end_early(clock, duration_ns=600 * S) == clock.ends_ns == now_ns + round(0.02 * scale * S)
    assert await keeper.end_early(clock, duration_ns=now_ns + 1) == clock.ends_ns == now_ns + 1


@given(
    st.lists(st.tuples(st.floats(0.01, 50), st.floats(0.3, 3), st.floats(0, 2)), max_size=6),
    st.floats(0.1, 20),
)
async def test_time_never_goes_back_and_every_clock_ends_where_the_keepers_is(
    steps: list[tuple[float, float, float]], scale: float
) -> None:
    """Steps of: seconds that pass, by what the pace changes, and how much later this process hears of it."""
    machine = Machine()
    keeper, told = await started(machine, scale)
    clock, latest_ns = SwarmClock(told, machine.keepers), 0
    for seconds, factor, later_s in steps:
        machine.let_pass(seconds)
        assert latest_ns <= (latest_ns := clock.now_ns())
        scale *= factor
        slower = keeper.pace(scale)
        machine.let_pass(later_s)
        assert latest_ns <= (latest_ns := clock.now_ns())
        clock.follow(slower)
        assert latest_ns <= clock.now_ns()
    machine.let_pass(10_000)
    assert keeper.clock is not None
    assert clock.now_ns() == SwarmClock(keeper.clock, machine.keepers).now_ns()


class Answering(Silent):
    """A bus on which the keeper answers all queries but the first ones."""

    def __init__(self, told: ClockEpoch, *, silent: int) -> None:
        self._told, self._silent = told, silent

    def subscribe(self, _expression: str, _on_sample: Callable[[str, bytes], None]) -> None: ...
    def check(self) -> None: ...

    def ask(self, key: str, on_answer: Callable[[str, bytes], None]) -> None:
        self._silent -= 1
        if self._silent < 0:
            on_answer(key, codecs.encode([self._told]))


@pytest.mark.parametrize(
    ("off_s", "silent", "said"),
    [
        (0, 0, ""),
        (0, 2, ""),
        (0.3, 2, ""),
        (-3600, 0, "is 3600.0 s behind"),
        (-3600, 2, "is 3600.0 s behind"),
        (3600, 2, r"is 3599.\d s ahead of"),
        (3600, 0, ""),  # it may join late
    ],
)
async def test_a_machine_whose_clock_is_far_from_the_keepers_is_told_and_takes_no_part(
    monkeypatch: pytest.MonkeyPatch, off_s: float, silent: int, said: str
) -> None:
    monkeypatch.setattr(clock_module, "_ASK_EVERY_S", 0.01)
    monkeypatch.setattr(clock_module, "_ASK_AGAIN_S", 0.0)
    machine = Machine()
    keeper = ClockKeeper(Silent(), Topics("far"), time_scale=1.0, expected=[], timebase=machine.keepers)  # type: ignore[arg-type]
    told = await keeper.start(timeout_s=1)
    off = Timebase(lambda: machine.other.unix_ns() + round(off_s * S), machine.other.mono_ns, 8)
    listener = clock_module.ClockListener(Answering(told, silent=silent), Topics("far"), off)  # type: ignore[arg-type]
    if not said:
        await listener.running(timeout_s=1)
        return
    with pytest.raises(BusError, match=said):
        await listener.running(timeout_s=1)


async def test_who_hears_late_from_a_keeper_on_the_same_machine_has_no_wrong_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """All services left a launcher that had stood still for 5 s when the clock began, and blamed NTP."""
    monkeypatch.setattr(clock_module, "_ASK_EVERY_S", 0.01)
    monkeypatch.setattr(clock_module, "_ASK_AGAIN_S", 0.0)
    machine = Machine()
    _, told = await started(machine, 1.0)
    machine.let_pass(5)
    listener = ClockListener(Answering(told, silent=2), Topics("slow"), machine.keepers)  # type: ignore[arg-type]
    assert (await listener.running(timeout_s=1)).now_ns() == 5 * S
    other = ClockListener(Answering(told, silent=2), Topics("slow"), machine.other)  # type: ignore[arg-type]
    with pytest.raises(BusError, match=r"5\.0 s ahead of"):
        await other.running(timeout_s=1)
