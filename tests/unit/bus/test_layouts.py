"""The reference of the bus says what the codecs do."""

import runpy
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fanet_mw.bus import codecs
from fanet_mw.bus import messages as m
from fanet_mw.bus.radio_control import Cut, Degrade, Mishap, MishapKind
from fanet_mw.units import Enu, NodeId

ROOT = Path(__file__).parents[3]
layouts = SimpleNamespace(**runpy.run_path(str(ROOT / "scripts" / "generate_bus_reference.py")))
CODES = {name: code for code, name in layouts.TYPES.items()}
SAMPLES = [
    m.TxRequest(7, 123_456_789_012, b"frame", NodeId(300), wants_status=True),
    m.Reception(b"frame", NodeId(3), 99, -71.5),
    m.TxStatus(8, m.TxOutcome.RETRY_LIMIT, 77, 6),
    m.Setpoint(5, Enu(1, 2, 3), 4.5, m.SetpointKind.VELOCITY, Enu(6, 7, 8)),
    m.Gps(5, Enu(1, 2, 3), Enu(4, 5, 6)),
    m.ClockEpoch(10, 2.0, m.ClockState.RUNNING, 11, 12),
    m.Altimeter(1, 50.0, 40.0),
    m.Battery(1, 15.2, 8.0, 0.5),
    m.FlightState(1, 0.1, 0.2, 0.3, 12, 0.7, 99),
    Degrade("link", NodeId(1), NodeId(2), both=True, loss_db=3.0, loss_share=0.25, for_ns=9),
    Cut("node", NodeId(4), 10, hears=True),
    Mishap("node", NodeId(4), MishapKind.GPS, Enu(1, 2, 3), 10),
]
"""Of each kind whose fields are its attributes."""


def flat(message: Any) -> list[float]:
    """The numbers of a message, vectors spread out, in the order of its attributes."""
    values: list[float] = []
    for value in message:
        values += list(value) if isinstance(value, Enu) else [value] if isinstance(value, int | float) else []
    return values


@pytest.mark.parametrize("message", SAMPLES, ids=lambda message: type(message).__name__)
def test_a_reader_by_the_reference_reads_what_was_sent(message: Any) -> None:
    data = codecs.encode([message])
    assert struct.unpack_from("<BI", data) == (codecs.CODES[type(message)], len(data) - 5)
    fields = layouts.head(type(message))
    read = [struct.unpack_from(f"<{CODES[field.kind]}", data, 5 + field.offset)[0] for field in fields]
    assert sorted(read) == sorted(flat(message))
    by_name = dict(zip((field.name for field in fields), read, strict=True))
    for name in set(by_name) & set(getattr(message, "_fields", ())):
        assert by_name[name] == getattr(message, name)


def test_every_message_has_its_layout() -> None:
    assert set(layouts.NAMED) == set(codecs.CODES) == set(codecs.HEADS)
    for kind in layouts.kinds():
        assert layouts.head(kind) or layouts.NAMED[kind].rest
        assert bool(layouts.row(kind)) == bool(layouts.NAMED[kind].row)


def test_a_struct_that_was_changed_without_its_names_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(codecs.HEADS, m.Gps, (struct.Struct("<q7d"),))
    with pytest.raises(ValueError, match="8 fields, 7 are named"):
        layouts.head(m.Gps)


def test_another_order_of_fields_or_another_struct_is_another_layout(monkeypatch: pytest.MonkeyPatch) -> None:
    assert codecs.layout_of(codecs.CODES) == codecs.LAYOUT
    with monkeypatch.context() as patch:
        patch.setattr(m.TxStatus, "__annotations__", dict(reversed(m.TxStatus.__annotations__.items())))
        assert codecs.layout_of(codecs.CODES) != codecs.LAYOUT
    monkeypatch.setitem(codecs.HEADS, m.Gps, (struct.Struct("<q7d"),))
    assert codecs.layout_of(codecs.CODES) != codecs.LAYOUT


def test_the_page_is_checked_against_the_codecs(tmp_path: Path) -> None:
    page = tmp_path / "bus.md"
    assert layouts.main([], document=page) == 0
    assert layouts.main(["--check"], document=page) == 0
    page.write_text(page.read_text().replace("uint16", "uint32", 1))
    assert layouts.main(["--check"], document=page) == 1
