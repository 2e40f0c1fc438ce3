"""Applications of a user beside the scenario's on one UAV, hand-driven: who is given what, and what becomes of it."""

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import common

from agents.uav import Uav
from fanet_mw import mavlink, wire
from fanet_mw.application import Application, AppPort, Course, Data, Fate, Received, Status
from fanet_mw.bus.messages import (
    Gps,
    MavlinkTap,
    Reception,
    SensorReading,
    Setpoint,
    TxOutcome,
    TxRequest,
    TxStatus,
    WifiScan,
)
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import DropReason, LocalProtocolError, MalformedFrameError
from fanet_mw.foreign_file import json_of
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Generated
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_REPORT, SURVIVOR, Header, Kind
from fanet_mw.wire.survivors import Survivor
from sim.records.bus_checks import BusChecks

NAMES, OWN, OTHER = Topics("u"), NodeId(2), NodeId(3)
HELLO = Data(5, b"hello")
ELSEWHERE = Course(Enu(100.0, 0.0, 50.0), 8.0)
MakeScenario = Callable[..., Scenario]


class Diary(Application):
    """Writes down what it is told."""

    listens = (SURVIVOR.msgid,)

    def __init__(self, name: str, *, wake_ns: int | None = None, permits: bool = True) -> None:
        self.name = name
        self.lines: list[Any] = []
        self.wake_ns = wake_ns
        self.willing = permits

    def on_message(self, message: Received, now_ns: int) -> None:
        self.lines.append((message.origin, message.born_ns, message.hops))
        if Survivor.decode_frame(message.frame).survivor == 7:
            raise MalformedFrameError("not that one")

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        self.lines.append(fix.position)

    def on_sensor(self, reading: SensorReading, now_ns: int) -> None:
        self.lines.append(reading)

    def permits(self, course: Course, now_ns: int) -> bool:
        self.lines.append(course)
        return self.willing

    def wake(self, now_ns: int) -> None:
        self.lines.append(now_ns)
        self.wake_ns = None

    def next_wake_ns(self) -> int | None:
        return self.wake_ns

    def report(self) -> dict[str, int]:
        return {"lines": len(self.lines)}


def uav(make_scenario: MakeScenario, *applications: Application, **keys: Any) -> Uav:
    given = {
        "nodes.count": 3,
        "routing.protocol": "flooding",
        "traffic.arrivals": "none",
        "routing.hello_interval_s": 0,
    }
    made = Uav(make_scenario(**given | keys), OWN, "u", position=Enu(0.0, 0.0, 50.0), applications=applications)
    made.start(0)
    return made


def hear(made: Uav, inner: bytes, *, seq: int = 5, now_ns: int = S) -> None:
    header = Header(900_000, seq, OTHER, BROADCAST, OTHER, Kind.DATA, 8, 0, PRIORITY_REPORT, FLAG_FLOOD)
    made.receive(NAMES.radio_rx(OWN), Reception(header.encode() + inner, OTHER, now_ns, -60.0), now_ns)


def survivor(number: int) -> bytes:
    return Survivor(900_000, number, OTHER, Enu(10.0, 20.0, 50.0), -70.0).encode_frame(OTHER)


def test_a_message_is_given_to_all_that_listen_to_it_and_to_no_other(make_scenario: MakeScenario) -> None:
    a, b, deaf = Diary("a"), Diary("b"), Diary("c")
    deaf.listens = ()
    made = uav(make_scenario, a, b, deaf)
    hear(made, survivor(1))
    hear(made, mavlink.Encoder(OTHER).heartbeat(), seq=6)
    assert a.lines == b.lines == [(OTHER, 900 * MS, 1)]
    assert deaf.lines == []


def test_what_makes_no_sense_to_an_application_is_counted_and_the_others_have_it(make_scenario: MakeScenario) -> None:
    made = uav(make_scenario, Diary("a"), last := Diary("b"))
    hear(made, survivor(7))
    assert made.report()["dropped"]["malformed"] == 2
    assert len(last.lines) == 1


def test_fixes_and_readings_go_to_all(make_scenario: MakeScenario) -> None:
    made = uav(make_scenario, diary := Diary("a"))
    scan = WifiScan(S, ())
    made.receive(NAMES.sensor(OWN, "gps"), Gps(S, Enu(1, 2, 3), Enu(0, 0, 0)), S)
    made.receive(NAMES.sensor(OWN, "wifi"), scan, S)
    assert diary.lines == [Enu(1, 2, 3), scan]


def test_each_is_woken_at_its_own_instant(make_scenario: MakeScenario) -> None:
    soon, late = Diary("a", wake_ns=300 * MS), Diary("b", wake_ns=700 * MS)
    made = uav(make_scenario, soon, late)
    for expected_ns in (300 * MS, 700 * MS):
        assert made.next_wake_ns() == expected_ns
        made.wake(expected_ns)
    assert (soon.lines, late.lines) == ([300 * MS], [700 * MS])
    assert made.next_wake_ns() is None


@pytest.mark.parametrize("wake_ns", [math.nan, 1e9])
def test_an_instant_that_is_no_whole_number_is_the_mistake_of_an_application_and_does_not_go_under(
    make_scenario: MakeScenario, wake_ns: float
) -> None:
    with pytest.raises(
        LocalProtocolError, match=r"'b' .test_onboard:Diary. of node 2: next_wake_ns\(\) = .* must be a whole"
    ):
        uav(make_scenario, Diary("a", wake_ns=300 * MS), Diary("b", wake_ns=wake_ns))  # type: ignore[arg-type]


@pytest.mark.parametrize("ports", ["5", (0,), (70_000,), (5.0,)])
def test_ports_at_which_nothing_could_arrive_are_refused(make_scenario: MakeScenario, ports: Any) -> None:
    diary = Diary("a")
    diary.ports = ports
    with pytest.raises(LocalProtocolError, match=r"'a' .*: ports = .* must be a collection of numbers in \[1, 65535\]"):
        uav(make_scenario, diary)


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        ("listens", b"\x07"),
        ("listens", "HEARTBEAT"),
        ("listens", (1 << 24,)),
        ("follows", "sent"),
        ("follows", ("seen",)),
        ("name", 5),
    ],
)
def test_attributes_that_mean_nothing_are_refused_with_the_class(
    make_scenario: MakeScenario, attribute: str, value: Any
) -> None:
    diary = Diary("a")
    setattr(diary, attribute, value)
    with pytest.raises(LocalProtocolError, match=rf"\(test_onboard:Diary\): {attribute} (= .* )?must be "):
        uav(make_scenario, diary)


def test_an_application_whose_method_nobody_would_await_is_refused(make_scenario: MakeScenario) -> None:
    class Waiting(Diary):
        async def on_message(self, message: Received, now_ns: int) -> None:  # type: ignore[override]
            self.lines.append(message)

    with pytest.raises(LocalProtocolError, match=r"Waiting\) has a method on_message that is async, and would never"):
        uav(make_scenario, Waiting("a"))


def test_an_instant_that_an_input_brings_nearer_is_heeded(make_scenario: MakeScenario) -> None:
    class Hasty(Diary):
        def on_message(self, message: Received, now_ns: int) -> None:
            self.wake_ns = now_ns + 10 * MS

    made = uav(make_scenario, Hasty("a", wake_ns=9 * S))
    assert made.next_wake_ns() == 9 * S
    hear(made, survivor(1))
    assert made.next_wake_ns() == S + 10 * MS


class Pilot(Application):
    """Wants to be elsewhere from its first fix on."""

    name = "pilot"

    def on_fix(self, fix: Gps, now_ns: int) -> None:
        self.port.fly(ELSEWHERE._replace(speed_m_s=1.0))
        self.port.fly(ELSEWHERE)

    def permits(self, course: Course, now_ns: int) -> bool:
        return False


@pytest.mark.parametrize("willing", [True, False])
def test_of_several_courses_the_last_is_flown_if_no_other_application_objects(
    make_scenario: MakeScenario, willing: bool
) -> None:
    made = uav(make_scenario, Pilot(), diary := Diary("judge", permits=willing))
    made.receive(NAMES.sensor(OWN, "gps"), Gps(S, Enu(1, 2, 3), Enu(0, 0, 0)), S)
    assert diary.lines[1:] == [ELSEWHERE]
    flown = [message for _, message in made.outbox if isinstance(message, Setpoint)]
    assert flown == ([Setpoint(S, ELSEWHERE.position, ELSEWHERE.speed_m_s)] if willing else [])


def test_who_avoids_collisions_keeps_no_course_for_later_to_which_another_objects(make_scenario: MakeScenario) -> None:
    """It flies that course once the others are clear: of a UAV whose operator holds it, too."""
    avoider, operator = Diary("avoider"), Diary("judge", permits=False)
    avoider.avoids = True
    made = uav(make_scenario, Pilot(), avoider, operator)
    fix = Gps(S, Enu(1, 2, 3), Enu(0, 0, 0))
    made.receive(NAMES.sensor(OWN, "gps"), fix, S)
    assert ELSEWHERE in operator.lines
    assert ELSEWHERE not in avoider.lines
    operator.willing = True
    made.receive(NAMES.sensor(OWN, "gps"), fix._replace(t_ns=2 * S), 2 * S)
    assert ELSEWHERE in avoider.lines


class Caller(Application):
    """Sends a heartbeat at second 1, as if it had meant to at another instant, and shows it."""

    name = "caller"

    def __init__(self, born_ns: int) -> None:
        self._born_ns = born_ns
        self._due_ns: int | None = S

    def next_wake_ns(self) -> int | None:
        return self._due_ns

    def wake(self, now_ns: int) -> None:
        self._due_ns = None
        frames = mavlink.Encoder(self.port.node).heartbeat()
        self.handle = self.port.send(frames, destination=OTHER, born_ns=self._born_ns)
        self.port.tap(frames)


@pytest.mark.parametrize("born_ns", [S - 5 * MS, S + 5 * MS])
def test_what_is_sent_is_traced_and_goes_out_one_lead_after_its_birth_which_is_never_later_than_now(
    make_scenario: MakeScenario, born_ns: int
) -> None:
    made = uav(make_scenario, caller := Caller(born_ns), **{"radio.lead_ms": 20, "routing.protocol": "direct"})
    made.wake(S)
    (request,) = [message for _, message in made.outbox if isinstance(message, TxRequest)]
    (tap,) = [message for _, message in made.outbox if isinstance(message, MavlinkTap)]
    (record,) = [record for record in made.records if isinstance(record, Generated)]
    assert record[1:4] == (OWN, caller.handle, "caller")
    assert record.t_ns == min(born_ns, S)
    assert request.start_ns == record.t_ns + 20 * MS
    assert request.frame.endswith(tap.data)


def test_two_applications_of_one_name_are_refused(make_scenario: MakeScenario) -> None:
    with pytest.raises(LocalProtocolError, match="each name must be there once"):
        uav(make_scenario, Diary("traffic"))


def test_a_report_has_what_a_users_applications_say(make_scenario: MakeScenario) -> None:
    made = uav(make_scenario, Diary("a"), Application())
    assert made.report()["applications"] == {"a": {"lines": 0}}


# --- messages to ports, and what becomes of them ---------------------------------------------------------------------


def test_a_report_with_values_that_json_does_not_know_is_told_as_far_as_it_does(make_scenario: MakeScenario) -> None:
    class Odd(Diary):
        def report(self) -> Any:
            return {
                "nan": math.nan,
                "set": {2, 1},
                "np": np.int64(3),
                "rows": np.eye(2),
                7: {"far": 2**70, "none": None},
            }

    class Silent(Diary):
        def report(self) -> Any:
            return None

    told = uav(make_scenario, Odd("odd"), Silent("silent")).report()["applications"]
    far = {"far": str(2**70), "none": None}
    assert told == {"odd": {"nan": "nan", "set": [1, 2], "np": 3, "rows": [[1.0, 0.0], [0.0, 1.0]], "7": far}}
    assert json.loads(json.dumps(told, allow_nan=False)) == told


def test_the_deepest_report_of_an_application_is_read_wherever_it_is_told(make_scenario: MakeScenario) -> None:
    class Deep(Diary):
        def report(self) -> Any:
            told: dict[str, Any] = {"leaf": 1}
            for _ in range(9):
                told = {"in": told}
            return told

    told = dict(uav(make_scenario, Deep("deep")).report())
    assert "report_failed" not in told["applications"]["deep"]
    name = f"agent-{told['node']}"
    content, why = BusChecks(make_scenario()).report(name, json.dumps({**told, "final": True}))
    assert why is None
    json_of(json.dumps({name: content}).encode(), source="reports.json")


class Looping(Diary):
    def report(self) -> Any:
        told: dict[str, Any] = {"lines": 1}
        return told | {"again": [told, told.setdefault("self", told)]}


class Failing(Diary):
    def report(self) -> Any:
        raise OSError("no such sensor")


@pytest.mark.parametrize(
    ("kind", "said"), [(Looping, "ValueError: deeper than 10"), (Failing, "OSError: no such sensor")]
)
def test_no_run_is_lost_for_a_report_that_fails(make_scenario: MakeScenario, kind: type[Diary], said: str) -> None:
    told = uav(make_scenario, kind("odd"), Diary("even")).report()["applications"]
    assert told == {"odd": {"report_failed": said}, "even": {"lines": 0}}


class Post(Application):
    """Sends what it is told to at second 1, and writes down what becomes of it."""

    name = "post"
    ports = (5,)
    follows = tuple(Fate)

    def __init__(self, content: object = HELLO, *, times: int = 1, **options: Any) -> None:
        self._content, self._options, self._times, self._due_ns = content, options, times, S
        self.told: list[Status] = []
        self.got: list[bytes] = []
        self.error: LocalProtocolError | None = None

    def next_wake_ns(self) -> int | None:
        return self._due_ns or None

    def wake(self, now_ns: int) -> None:
        self._due_ns = 0
        try:
            for _ in range(self._times):
                self.handle = self.port.send(self._content, **self._options)
        except LocalProtocolError as error:
            self.error = error

    def on_status(self, status: Status, now_ns: int) -> None:
        self.told.append(status)

    def on_message(self, message: Received, now_ns: int) -> None:
        self.got.append(message.data)


def live(made: Uav, until_ns: int) -> list[TxRequest]:
    """Wake a UAV whenever it asks for it; what it announced."""
    found: list[TxRequest] = []
    now_ns = 0
    while (wake_ns := made.next_wake_ns()) is not None and wake_ns <= until_ns:
        now_ns = max(now_ns, wake_ns)
        made.wake(now_ns)
        found += [message for _, message in made.outbox if isinstance(message, TxRequest)]
        made.outbox.clear()
    return found


@pytest.mark.parametrize("content", [Data(5, bytes(3000)), mavlink.Encoder(OWN).heartbeat()], ids=["bytes", "mavlink"])
def test_a_message_that_nobody_confirms_is_sent_again_until_its_lifetime_is_over(
    make_scenario: MakeScenario, content: bytes | Data
) -> None:
    post = Post(content, destination=OTHER, confirm=True, lifetime_ns=4 * S)
    made = uav(make_scenario, post)
    frames = live(made, 10 * S)
    pieces = 1 if isinstance(content, bytes) else 2
    assert len(frames) >= 2 * pieces
    assert [status.fate for status in post.told] == [Fate.ADMITTED, Fate.LET_OUT, Fate.EXPIRED]
    assert post.told[-1] == Status(post.handle, Fate.EXPIRED, 5 * S, nodes=(OTHER,), last=True)


def test_a_mavlink_message_that_is_to_be_confirmed_is_sent_again(make_scenario: MakeScenario) -> None:
    post = Post(mavlink.Encoder(OWN).heartbeat(), destination=OTHER, confirm=True)
    assert len(live(uav(make_scenario, post), 10 * S)) >= 2


def test_what_is_not_to_be_confirmed_is_sent_once(make_scenario: MakeScenario) -> None:
    post = Post(destination=BROADCAST)
    frames = live(uav(make_scenario, post), 10 * S)
    assert len(frames) == 1
    assert [status.fate for status in post.told] == [Fate.ADMITTED, Fate.LET_OUT]


@pytest.mark.parametrize("protocol", ["flooding", "direct"])
@pytest.mark.parametrize(("outcome", "attempts", "fate"), [
    (TxOutcome.SENT, 1, Fate.SENT), (TxOutcome.RETRY_LIMIT, 7, Fate.SENT), (TxOutcome.QUEUE_FULL, 0, Fate.TURNED_AWAY),
])  # fmt: skip
@pytest.mark.parametrize("content", [HELLO, mavlink.Encoder(OWN).heartbeat()], ids=["bytes", "mavlink"])
def test_what_the_radio_has_done_with_a_message_is_told(
    make_scenario: MakeScenario, protocol: str, outcome: TxOutcome, attempts: int, fate: Fate, content: object
) -> None:
    post = Post(content, destination=BROADCAST)
    made = uav(make_scenario, post, **{"routing.protocol": protocol})
    (request,) = live(made, 2 * S)
    assert request.wants_status
    status = TxStatus(request.seq, outcome, 2 * S, attempts)
    for _ in range(2):  # the second time for a request of which everything is said
        made.receive(NAMES.radio_rx(OWN), status, 3 * S)
    assert [(one.fate, one.t_ns) for one in post.told if one.fate in (Fate.SENT, Fate.TURNED_AWAY)] == [(fate, 3 * S)]


def test_of_a_message_in_pieces_the_first_frame_counts(make_scenario: MakeScenario) -> None:
    post = Post(Data(5, bytes(5000)), destination=BROADCAST)
    requests = live(made := uav(make_scenario, post), 2 * S)
    assert [request.wants_status for request in requests] == [True] + [False] * (len(requests) - 1)
    assert len(requests) > 2
    for request in requests:
        made.receive(NAMES.radio_rx(OWN), TxStatus(request.seq, TxOutcome.SENT, 2 * S, 1), 3 * S)
    assert [one.fate for one in post.told] == [Fate.ADMITTED, Fate.LET_OUT, Fate.SENT]


def test_the_radio_need_not_report_to_an_application_that_does_not_ask(make_scenario: MakeScenario) -> None:
    post = Post(destination=BROADCAST)
    post.follows = (Fate.LET_OUT, Fate.DROPPED)
    (request,) = live(uav(make_scenario, post), 2 * S)
    assert not request.wants_status


class Insists(Post):
    """Sends again when a message was dropped."""

    def on_status(self, status: Status, now_ns: int) -> None:
        super().on_status(status, now_ns)
        if status.fate in (Fate.DROPPED, Fate.EXPIRED) and len(self.told) < 4:
            self.handle = self.port.send(self._content, **self._options)


def test_what_is_sent_in_answer_to_a_drop_is_born_at_that_instant(make_scenario: MakeScenario) -> None:
    """Nothing but the node's own timer led to it, so that no application had been called for a while."""
    post = Insists(destination=OTHER)
    made = uav(make_scenario, post, **{"routing.protocol": "dsdv", "routing.lifetime_s": 5})
    live(made, 10 * S)
    dropped_ns = next(status.t_ns for status in post.told if status.last)
    born_ns = [record.t_ns for record in made.records if isinstance(record, Generated) and record.app == "post"]
    assert dropped_ns > 2 * S
    assert born_ns[:2] == [S, dropped_ns]


def test_what_the_node_drops_is_told_with_the_reason(make_scenario: MakeScenario) -> None:
    post = Post(destination=OTHER)
    live(uav(make_scenario, post, **{"routing.protocol": "dsdv", "routing.lifetime_s": 5}), 10 * S)
    assert post.told[-1].last
    assert (post.told[-1].fate, post.told[-1].reason) in (
        (Fate.DROPPED, DropReason.NO_ROUTE), (Fate.EXPIRED, DropReason.EXPIRED)
    )  # fmt: skip


def test_messages_that_cannot_be_kept_are_refused(make_scenario: MakeScenario) -> None:
    post = Post(Data(5, bytes(60_000)), times=80, destination=OTHER, confirm=True)
    live(uav(make_scenario, post), S)
    fates = [status.fate for status in post.told if status.fate is not Fate.LET_OUT]
    assert fates == [Fate.ADMITTED] * 70 + [Fate.REFUSED] * 10, "four megabytes are kept"
    assert {s.reason for s in post.told if s.fate is Fate.REFUSED} == {DropReason.QUEUE_FULL}


@pytest.mark.parametrize(
    ("content", "options"),
    [
        (Data(0, b""), {}),
        (Data(70_000, b""), {}),
        (Data("5", b""), {}),
        (Data(5, "text"), {}),
        (b"hello", {}),
        (mavlink.Encoder(OWN).heartbeat()[:-1], {}),
        (b"", {}),
        ("text", {}),
        (Data(5, bytes(200_000)), {}),
        (Data(5, b""), {"destination": (OWN,)}),
        (Data(5, b""), {"destination": (9, 2)}),
        (Data(5, b""), {"destination": 0}),
        (Data(5, b""), {"destination": 9}),
        (Data(5, b""), {"destination": OWN}),
        (Data(5, b""), {"destination": "all"}),
        (Data(5, b""), {"destination": None}),
        (Data(5, b""), {"priority": "urgent"}),
        (Data(5, b""), {"priority": wire.PRIORITY_CONTROL}),
        (Data(5, b""), {"lifetime_ns": 0}),
        (Data(5, b""), {"deadline_ns": -1}),
        (mavlink.Encoder(OWN).heartbeat() * 200, {"confirm": True}),
    ],
)
def test_what_cannot_be_sent_at_all_is_a_mistake_of_the_application(
    make_scenario: MakeScenario, content: object, options: dict[str, Any]
) -> None:
    made = uav(make_scenario, post := Post(content, **options))
    made.wake(S)
    assert post.error is not None
    assert "must be" in str(post.error)
    assert made.outbox == []


def test_a_message_of_pymavlink_is_sent_as_its_frame_and_a_priority_by_its_name(make_scenario: MakeScenario) -> None:
    message = common.MAVLink_statustext_message(5, b"found")
    (frame,) = live(uav(make_scenario, Post(message, priority="report")), 2 * S)
    header = wire.decode_header(frame.frame)
    assert header.priority == wire.PRIORITY_REPORT
    (heard,) = mavlink.decode(frame.frame[wire.HEADER_BYTES :])
    assert (heard.get_type(), heard.get_srcSystem(), heard.text) == ("STATUSTEXT", OWN, "found")


@pytest.mark.parametrize(
    "course",
    [
        (1, 2, 3),
        Course((1, 2, 3), 5.0),  # type: ignore[arg-type]
        Course(Enu(math.nan, 0.0, 0.0), 5.0),
        Course(Enu(0.0, 0.0, 0.0), "fast"),  # type: ignore[arg-type]
        Course(Enu(0.0, 0.0, 0.0), math.inf),
        Course(Enu(0.0, 0.0, 0.0), 5.0, Enu(0.0, None, 0.0)),  # type: ignore[arg-type]
    ],
)
def test_a_course_is_a_course(make_scenario: MakeScenario, course: Any) -> None:
    class Pilot(Application):
        name = "pilot"

        def start(self, port: AppPort, now_ns: int) -> None:
            port.fly(course)

    with pytest.raises(
        LocalProtocolError, match=r"application 'pilot' \(.*Pilot\): course = .* must be a Course of finite numbers"
    ):
        uav(make_scenario, Pilot())
