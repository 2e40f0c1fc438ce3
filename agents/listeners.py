"""Which applications on board are called for each input: those that implement its method, or asked for its port."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

from fanet_mw.application import ANY, Application
from fanet_mw.wire import CHUNK


class Callbacks(NamedTuple):
    """For each method that an application may implement, the applications that do, in the order on board."""

    on_fix: tuple[Application, ...]
    on_sensor: tuple[Application, ...]
    on_hello: tuple[Application, ...]
    on_operator: tuple[Application, ...]
    on_record: tuple[Application, ...]
    permits: tuple[Application, ...]
    hello_frames: tuple[Application, ...]
    next_wake_ns: tuple[Application, ...]

    @classmethod
    def of(cls, applications: Sequence[Application]) -> Self:
        """Find the methods that the class of each application overrides."""

        def overriding(method: str) -> tuple[Application, ...]:
            inherited = getattr(Application, method)
            return tuple(a for a in applications if getattr(type(a), method) is not inherited)

        return cls(*[overriding(method) for method in cls._fields])


class Listeners:
    """The applications on board, by the messages to which they listen."""

    def __init__(self, applications: Sequence[Application]) -> None:
        self._to_message: dict[int, list[Application]] = {}
        self._to_port: dict[int, list[Application]] = {}
        self._to_every_message = [a for a in applications if a.listens == ANY]
        self._to_every_port = [a for a in applications if a.ports == ANY]
        for application in applications:
            for message_id in application.listens if application.listens != ANY else ():
                self._to_message.setdefault(message_id, []).append(application)
            for port in application.ports if application.ports != ANY else ():
                self._to_port.setdefault(port, []).append(application)

    def of_message(self, message_id: int) -> Sequence[Application]:
        """The applications that listen to a message; FANET_CHUNK, mostly filler, goes only to those that name it."""
        named = self._to_message.get(message_id, [])
        return named if message_id == CHUNK.msgid else [*named, *self._to_every_message]

    def of_port(self, port: int) -> Sequence[Application]:
        """The applications that listen to a port: those that name it, then those that listen to all ports."""
        return [*self._to_port.get(port, ()), *self._to_every_port]

    def wanted(self, also: Iterable[int]) -> frozenset[bytes] | None:
        """Ids to which any application listens, and those in `also`, as three bytes of a frame; None: all."""
        if self._to_every_message:
            return None
        return frozenset(message_id.to_bytes(3, "little") for message_id in (*self._to_message, *also))
