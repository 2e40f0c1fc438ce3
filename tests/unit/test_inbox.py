"""The inbox of a real-time host: bounded, fair among topics, and every put is counted once."""

import threading
from array import array

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw import topics
from fanet_mw.hosts.inbox import BOUND, TURN, Inbox
from fanet_mw.messages import MavlinkTap, Message, Poses

TAP = topics.encode([MavlinkTap(1, b"x")])


def delivered(inbox: Inbox, *, most: int = TURN) -> list[str]:
    heard: list[str] = []

    def receive(topic: str, _message: Message) -> None:
        heard.append(topic)

    inbox.deliver(receive, most=most)
    return heard


@given(st.lists(st.one_of(st.sampled_from(["a", "b", "c"]), st.none(), st.integers(1, 9)), max_size=200))
def test_every_put_is_taken_malformed_overflowed_or_waiting_and_none_overtakes(script: list[str | int | None]) -> None:
    """A script of puts on topics, malformed puts (None) and turns of so many."""
    inbox = Inbox(bound=12)
    offered: list[str] = []
    heard: list[str] = []
    for step in script:
        if isinstance(step, int):
            heard += delivered(inbox, most=step)
        else:
            before = inbox.overflowed
            inbox.offer(step or "a", TAP if step else b"\xff")
            if step and inbox.overflowed == before:
                offered.append(step)
        figures = inbox.figures()
        assert figures["waiting"] <= 12
        rest = figures["taken"] + figures["malformed"] + figures["overflowed"] + figures["waiting"]
        assert figures["samples"] == rest
    heard += delivered(inbox)
    assert heard == offered


def test_one_topic_that_floods_leaves_room_for_the_others() -> None:
    inbox = Inbox()
    for _ in range(10 * BOUND):
        inbox.offer("flood", TAP)
    assert inbox.figures()["waiting"] == BOUND // 4
    assert inbox.figures()["share_full"] == inbox.overflowed == 10 * BOUND - BOUND // 4
    for i in range(100):
        inbox.offer(f"calm-{i}", TAP)
    assert inbox.figures()["waiting"] == BOUND // 4 + 100
    while len(found := delivered(inbox)) == TURN:
        pass
    assert found[-1] == "calm-99"
    inbox.offer("flood", TAP)
    assert delivered(inbox) == ["flood"], "its share is free again"


def test_more_topics_than_there_can_be_share_one_share() -> None:
    inbox = Inbox(bound=100_000)
    for i in range(60_000):
        inbox.offer(f"{i}", TAP)
    assert inbox.figures()["waiting"] == 8192 + 25_000
    for i in range(100_000):
        inbox.offer(f"{i % 8000}", TAP)
    assert inbox.figures()["waiting"] == 100_000
    assert inbox.inbox_full == 100_000 - (100_000 - 8192 - 25_000)
    assert len(inbox._offered) <= 8193


def test_two_threads_at_its_two_ends_lose_nothing() -> None:
    """What the bus delivers while the actor takes it."""
    inbox = Inbox(bound=64)
    heard: list[Message] = []
    puts = [topics.encode([Poses(i, array("H"), array("d"))]) for i in range(20_000)]

    def bus() -> None:
        for payload in puts:
            inbox.offer("pose", payload)

    thread = threading.Thread(target=bus)
    thread.start()
    while thread.is_alive():
        inbox.deliver(lambda _, message: heard.append(message))
    thread.join()
    inbox.deliver(lambda _, message: heard.append(message))
    instants = [message.t_ns for message in heard if isinstance(message, Poses)]
    assert instants == sorted(instants)
    assert len(instants) == inbox.taken == 20_000 - inbox.overflowed
