"""Units of a scenario's keys: which unit each key has by its name, and values that are written with a unit.

`duration_s = "2 min"` and `--set radio.lead_ms=0.06s` are accepted, because the unit is converted into that of the key.
A unit of another dimension is refused, and so is a unit for a key that has none: no unit is ever ignored.
"""

import re
import unicodedata
from collections.abc import Mapping
from decimal import Decimal
from typing import Final

_TIME: Final = {"ns": "1e-9", "us": "1e-6", "ms": "1e-3", "s": "1", "min": "60", "h": "3600"}
_LENGTH: Final = {"mm": "1e-3", "cm": "1e-2", "m": "1", "km": "1e3"}
_SPEED: Final = {"m/s": "1", "km/h": "1/3.6"}
_FREQUENCY: Final = {"Hz": "1", "kHz": "1e3", "MHz": "1e6", "GHz": "1e9"}
_BIT_RATE: Final = {"kb/s": "1e3", "Mb/s": "1e6", "kbps": "1e3", "Mbps": "1e6"}
_SUFFIXES: Final[Mapping[str, tuple[str, Mapping[str, str]]]] = {
    "_m_s2": ("m/s²", {"m/s2": "1", "m/s²": "1"}),
    "_m_s": ("m/s", _SPEED),
    "_deg_s": ("°/s", {"deg/s": "1"}),
    "_ns": ("ns", _TIME),
    "_us": ("us", _TIME),
    "_ms": ("ms", _TIME),
    "_s": ("s", _TIME),
    "_m": ("m", _LENGTH),
    "_m2": ("m²", {"m2": "1", "m²": "1"}),
    "_per_hour": ("per hour", {"per hour": "1"}),
    "_pixels": ("pixels", {"pixels": "1", "px": "1"}),
    "_mhz": ("MHz", _FREQUENCY),
    "_hz": ("Hz", _FREQUENCY),
    "_mbps": ("Mb/s", _BIT_RATE),
    "_bytes": ("bytes", {"bytes": "1", "B": "1", "kB": "1e3", "KiB": "1024"}),
    "_dbm": ("dBm", {"dBm": "1"}),
    "_dbi": ("dBi", {"dBi": "1"}),
    "_db": ("dB", {"dB": "1"}),
    "_ppm": ("ppm", {"ppm": "1"}),
    "_deg": ("°", {"deg": "1", "°": "1"}),
    "_wh": ("Wh", {"Wh": "1"}),
    "_w": ("W", {"W": "1", "kW": "1e3"}),
    "_v": ("V", {"V": "1"}),
    "_ah": ("Ah", {"Ah": "1"}),
    "_kg": ("kg", {"g": "1e-3", "kg": "1"}),
    "_c": ("°C", {"C": "1", "°C": "1"}),
}
"""The unit of each ending of a key's name, the longest first, and factors of units of the same dimension."""
_QUANTITY: Final = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?+)\s*([a-zA-Z\u03bc°][a-zA-Z\u03bc°/0-9]*)")


_NO_UNIT: Final = frozenset({"nakagami_m"})
"""Keys whose names end like a unit, but whose values have none: the shape m of a distribution."""


def unit_of(key: str) -> str:
    """The unit by the ending of a key's name; empty if the name has no such ending."""
    found = _entry(key)
    return found[0] if found else ""


def in_unit_of(key: str, text: str) -> float | None:
    """A number with a unit, in that of the key; None if it is none. Raises ValueError with accepted units."""
    match = _QUANTITY.fullmatch(unicodedata.normalize("NFKC", text).replace("\u2212", "-").strip())
    if match is None:
        return None
    number, unit = match[1], match[2].replace("\u03bc", "u")
    found = _entry(key)
    if found is None:
        raise ValueError(f"{unit!r} is not understood: the key has no unit")
    own, worth = found
    own_name = next(name for name in worth if name.replace("°", "deg") == own.replace("°", "deg") or name == own)
    if unit not in worth:
        raise ValueError(f"{unit!r} is not understood: a number in {own}, or with one of {', '.join(worth)}")
    return float(Decimal(number) * _worth(worth[unit]) / _worth(worth[own_name]))


def _entry(key: str) -> tuple[str, Mapping[str, str]] | None:
    if key in _NO_UNIT:
        return None
    return next((entry for suffix, entry in _SUFFIXES.items() if f"_{key}".endswith(suffix)), None)


def _worth(text: str) -> Decimal:
    whole, _, part = text.partition("/")
    return Decimal(whole) / Decimal(part or "1")
