"""Messages of twelve nodes over the emulated radio, at any time, of any size and to anyone, while links lose frames."""

import random
from collections import defaultdict
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import pytest

from agents.uav import Uav
from emulator.medium import Medium
from fanet_mw.application import Application, Data, Destination, Fate, Received, Status
from fanet_mw.delivery import receiver, sender
from fanet_mw.hosts.virtual import VirtualHost
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, NodeId, S
from sim.world.environment.layout import positions
from sim.world.world import WorldActor

MakeScenario = Callable[..., Scenario]
COUNT: Final = 12
LONGEST: Final = 10_000
PORTS: Final = (5, 6)
LIFETIME_S: Final = 30


class Letter(NamedTuple):
    """One message that is to be sent."""

    at_ns: int
    port: int
    data: bytes
    destination: Destination
    priority: int


class Correspondent(Application):
    """Sends what it was given to send, each at its instant, and writes down what it gets and is told."""

    name = "letters"
    ports = PORTS
    follows = tuple(Fate)

    def __init__(self, letters: list[Letter]) -> None:
        self.to_send = sorted(letters)[::-1]
        self.sent: dict[int, Letter] = {}
        self.got: list[Received] = []
        self.told: dict[int, list[Status]] = defaultdict(list)

    def next_wake_ns(self) -> int | None:
        return self.to_send[-1].at_ns if self.to_send else None

    def wake(self, now_ns: int) -> None:
        while self.to_send and self.to_send[-1].at_ns <= now_ns:
            letter = self.to_send.pop()
            handle = self.port.send(
                Data(letter.port, letter.data),
                destination=letter.destination,
                priority=letter.priority,
                confirm=True,
                lifetime_ns=LIFETIME_S * S,
            )
            self.sent[handle] = letter

    def on_message(self, message: Received, now_ns: int) -> None:
        self.got.append(message)

    def on_status(self, status: Status, now_ns: int) -> None:
        self.told[status.handle].append(status)


def targets(node: int, letter: Letter) -> set[int]:
    if letter.destination == BROADCAST:
        return set(range(1, COUNT + 1)) - {node}
    return {letter.destination} if isinstance(letter.destination, int) else set(letter.destination)


def letters(count: int, over_s: float) -> dict[int, list[Letter]]:
    """So many letters of any nodes to anyone, each with content of its own."""
    pick = random.Random(5)
    found: dict[int, list[Letter]] = {node: [] for node in range(1, COUNT + 1)}
    for number in range(count):
        node = pick.randint(1, COUNT)
        others = [NodeId(other) for other in range(1, COUNT + 1) if other != node]
        several = tuple(pick.sample(others, pick.randint(2, 5)))
        destination = pick.choice([BROADCAST, pick.choice(others), several])
        data = b"" if number % 20 == 0 else number.to_bytes(4) + pick.randbytes(int(pick.random() ** 2 * (LONGEST - 4)))
        at_ns = int((2 + pick.random() * over_s) * S)
        found[node].append(Letter(at_ns, pick.choice(PORTS), data, destination, pick.randint(1, 3)))
    return found


def run(scenario: Scenario, given: dict[int, list[Letter]]) -> tuple[dict[int, Correspondent], dict[int, Any]]:
    places = positions(scenario)
    mails = {node: Correspondent(given[node]) for node in scenario.node_ids}
    uavs = [
        Uav(scenario, NodeId(node), "m", position=places[node - 1], applications=[mails[node]])
        for node in scenario.node_ids
    ]
    host = VirtualHost([WorldActor(scenario, "m"), Medium(scenario, "m"), *uavs])
    host.start()
    most_bytes = 0
    for second in range(1, int(scenario.duration_s) + 1):
        host.run(second * S)
        for uav in uavs:
            messenger = uav._onboard._messenger
            most_bytes = max(most_bytes, messenger._receiver.kept_bytes)
            assert messenger._sender._kept_bytes < sender.MOST_BYTES + LONGEST
            assert messenger._receiver.kept_bytes <= receiver.MOST_BYTES
            assert len(messenger._statuses._watched) <= 8192
            assert len(messenger._receiver._done) <= 8192
    host.stop()
    return mails, {"most_bytes": most_bytes, "reports": [uav.report() for uav in uavs]}


def check(mails: dict[int, Correspondent]) -> dict[str, int]:
    """Each letter is with each target once and as it was, in order, or its sender has been told who lacks it."""
    figures: dict[str, int] = defaultdict(int)
    arrived: dict[tuple[int, int], list[tuple[int, Letter]]] = defaultdict(list)
    for node, mail in mails.items():
        left: dict[tuple[int, int, bytes, int], list[int]] = defaultdict(list)
        for other, writer in mails.items():
            for handle, letter in sorted(writer.sent.items()):
                if node in targets(other, letter):
                    left[other, letter.port, letter.data, letter.priority].append(handle)
        for message in mail.got:
            handles = left[message.origin, message.port, message.data, message.priority]
            assert handles, "nothing arrives that was not sent, nor twice"
            handle = handles.pop(0)
            arrived[message.origin, handle].append((node, mails[message.origin].sent[handle]))
            mail.told[-1].append(Status(handle, Fate.ADMITTED, 0, nodes=(message.origin,)))
        in_order: dict[Any, list[int]] = defaultdict(list)
        for told in mail.told.pop(-1, []):
            (origin,) = told.nodes
            letter = mails[origin].sent[told.handle]
            if letter.data:  # empty ones are all alike
                in_order[origin, frozenset(targets(origin, letter)), letter.port, letter.priority].append(told.handle)
        assert all(handles == sorted(handles) for handles in in_order.values())
    for node, mail in mails.items():
        for handle, letter in mail.sent.items():
            told = mail.told[handle]
            assert [status.last for status in told] == [False] * (len(told) - 1) + [True]
            has = {target for target, _ in arrived[node, handle]}
            acknowledged = {n for status in told if status.fate is Fate.ACKNOWLEDGED for n in status.nodes}
            lacking = {n for status in told if status.fate is Fate.EXPIRED for n in status.nodes}
            refused = told[-1].fate is Fate.REFUSED
            assert refused or acknowledged | lacking == targets(node, letter)
            assert not acknowledged & lacking
            assert letter.data == b"" or acknowledged <= has
            figures["copies"] += len(targets(node, letter))
            figures["acknowledged"] += len(acknowledged)
            figures["expired"] += len(lacking)
            figures["refused"] += refused
            figures["arrived"] += len(has)
    return figures


KEYS: Final = {
    "nodes.count": COUNT, "nodes.spacing_m": 100, "traffic.arrivals": "none", "routing.lifetime_s": 30,
    "routing.safety_lifetime_s": 0, "clusters.count": 3, "clusters.flooding_period_s": 0.5,
    "faults": [{"at_s": 0, "kind": "degrade", "src": 1, "dst": 2, "loss_share": 0.3},
               {"at_s": 0, "kind": "degrade", "src": 7, "dst": 6, "loss_share": 0.3},
               {"at_s": 10, "kind": "cut", "node": 9, "for_s": 5}],
}  # fmt: skip


@pytest.mark.parametrize("protocol", [pytest.param("flooding", marks=pytest.mark.slow), "clustered", "aodv"])
def test_every_message_arrives_once_whole_and_in_order_or_its_sender_is_told_who_lacks_it(
    make_scenario: MakeScenario, protocol: str
) -> None:
    scenario = make_scenario(**KEYS, **{"routing.protocol": protocol, "duration_s": 60})
    mails, _ = run(scenario, letters(50, over_s=25))
    figures = check(mails)
    assert figures["acknowledged"] > 0.97 * figures["copies"]


def test_who_was_out_of_reach_for_ten_seconds_soon_has_all_that_was_sent_meanwhile_in_order(
    make_scenario: MakeScenario,
) -> None:
    faults = [{"at_s": 5, "kind": "cut", "node": 9, "for_s": 10}]
    scenario = make_scenario(**{**KEYS, "faults": faults, "routing.protocol": "flooding", "duration_s": 25})
    given = {node: list[Letter]() for node in scenario.node_ids}
    given[1] = [Letter((2 + 2 * n) * S, PORTS[0], bytes([n]) * 3000, NodeId(9), 3) for n in range(9)]
    mails, _ = run(scenario, given)
    assert [message.data[0] for message in mails[9].got] == [*range(9)]


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_ten_thousand_messages_arrive_once_whole_and_in_order_or_their_senders_are_told(
    make_scenario: MakeScenario,
) -> None:
    scenario = make_scenario(**KEYS, **{"routing.protocol": "clustered", "duration_s": 640})
    mails, more = run(scenario, letters(10_000, over_s=600))
    figures = check(mails)
    print(figures, more["most_bytes"])
    assert sum(len(mail.sent) for mail in mails.values()) == 10_000
