"""The view of a swarm that flies shows what befalls it, and what is pressed in it happens."""

import asyncio
import threading
import time

import pytest

from fanet_mw.units import S
from sim.observation.bus_feed import BusFeed
from sim.observation.swarm_state import SwarmState
from sim.run.api import launch
from sim.view.actions import Actions


class Watcher:
    """What `fanet view` does, without a browser: a feed, a state, and actions."""

    def __init__(self, endpoint: str, swarm: str) -> None:
        self.ends = False
        self.shares: list[tuple[float, float]] = []
        self.paces: list[float] = []
        self.events: list[str] = []
        self.late = self.then = ""
        self.failure: BaseException | None = None
        self._where = endpoint, swarm
        self.thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        try:
            with BusFeed(*self._where) as feed:
                self._watch(feed)
        except BaseException as error:  # noqa: BLE001  (it is reported by the test)
            self.failure = error

    def _watch(self, feed: BusFeed) -> None:
        state, actions = SwarmState(feed.scenario), Actions(feed)
        feed.listen()
        done: set[str] = set()

        def once(name: str, due_s: float) -> bool:
            if name in done or feed.now_ns() < due_s * S:
                return False
            done.add(name)
            return True

        while not self.ends and not feed.over:
            feed.pump(state)
            share = state.metrics()["delivered_share"]
            if share is not None:
                self.shares.append((feed.now_ns() / S, share))
            self.paces.append(feed.time_scale)
            if once("cut", 11):
                actions.cut(next(iter(state.heads())))
            if once("slow", 12):
                actions.pace(0.5)
            if once("run", 13):
                actions.pace(1.0)
            if once("late", 17):
                self.then = stands(state)
                self.late = stands(self._come_late())
            if once("restore", 21):
                actions.restore()
            time.sleep(0.1)
        self.events = [event.text for event in state.latest_events(200)]

    def _come_late(self) -> SwarmState:
        with BusFeed(*self._where) as feed:
            state = SwarmState(feed.scenario)
            feed.listen(catches_up=True)
            end_s = time.monotonic() + 5
            while stands(state) != self.then and time.monotonic() < end_s:
                feed.pump(state)
                time.sleep(0.1)
        return state


def stands(state: SwarmState) -> str:
    """What an observer can know only from whoever was there before."""
    uavs = [(node, uav.role, uav.cluster, uav.head) for node, uav in sorted(state.uavs.items())]
    return f"{uavs}, faults {sorted(state.faults)}"


@pytest.mark.slow
def test_a_head_that_is_cut_in_a_view_costs_deliveries_and_the_clock_obeys() -> None:
    async def run() -> Watcher:
        async with launch("quick", overrides=["duration_s=24"]) as launched:
            await asyncio.sleep(1)
            watcher = Watcher(launched.radio.endpoint, launched.radio.swarm)
            watcher.thread.start()
            while watcher.thread.is_alive():  # noqa: ASYNC110
                await asyncio.sleep(0.2)
        assert launched.result is not None
        slowed = launched.result.summary["slowed"]
        assert [step["time_scale"] for step in slowed] == [0.5, 1.0]
        return watcher

    watcher = asyncio.run(run())
    assert watcher.failure is None
    assert 0.5 in watcher.paces
    before = [share for t_s, share in watcher.shares if t_s < 11]
    after = [share for t_s, share in watcher.shares if 19 < t_s < 21]
    assert before[-1] > 0.9
    assert after[-1] < 0.85, "56 of 72 copies are left when one of nine is silent"
    assert watcher.late == watcher.then
    assert "head" in watcher.late
    assert "node-" in watcher.late, "the fault"
    assert any("radio fault cut" in text and "begins" in text for text in watcher.events)
    assert any("radio fault cut" in text and "ends" in text for text in watcher.events)
