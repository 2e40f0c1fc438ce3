"""Generate the tables of fields in docs/reference/air-*.md, from the dialect and the codecs; `--check` compares."""

import re
import struct
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # this tree, not the package that is installed

from fanet_mw import wire  # noqa: E402
from fanet_mw.dialect import fanet  # noqa: E402
from scripts.generated import write_or_check  # noqa: E402

PAGES: Final = ("air-format.md", "air-messages.md", "air-messages-clusters.md", "air-messages-search.md")
TYPES: Final = {
    "uint64_t": "Q",
    "uint32_t": "I",
    "uint16_t": "H",
    "int16_t": "h",
    "uint8_t": "B",
    "int8_t": "b",
    "float": "f",
}
SHORTER: Final = {"FANET_CHUNK": "17-", "FANET_ROUTING": "17-", "FANET_SEARCH": "57-", "FANET_ROLL": "22-"}
"""The least lengths of messages whose length depends on their content."""
PART: Final = re.compile(
    r"(<!-- fields: (\w+) by scripts/generate_air_reference.py -->\n).*?(<!-- end of \2 -->\n)", re.DOTALL
)


def described(spec: wire.Spec, entry: ET.Element) -> str:
    """What the dialect says of a message, its sizes, and its fields in the order of the wire."""
    message: Any = fanet.mavlink_map[spec.msgid]
    size = spec.layout.size
    text = [
        f"{entry.findtext('description')}",
        f"Payload {size} bytes, frame {size + wire.OVERHEAD}, CRC_EXTRA {spec.crc_extra}.",
        "",
        "| offset | field | type | unit | meaning |",
        "|--:|---|---|---|---|",
    ]
    fields = {field.get("name", ""): field for field in entry.iter("field")}
    layout = "<"
    for name in message.ordered_fieldnames:
        field = fields[name]
        kind, _, count = field.get("type", "").removesuffix("]").partition("[")
        shown = kind.removesuffix("_t") + (f"[{count}]" if count else "")
        unit = field.get("units", "")
        text.append(f"| {struct.calcsize(layout)} | `{name}` | {shown} | {unit + ' ' if unit else ''}| {field.text} |")
        layout += count + TYPES[kind]
    assert layout == spec.layout.format, f"the codec of {message.msgname} is not that of the dialect"
    return "\n".join(text) + "\n"


def listed(entries: Mapping[str, ET.Element]) -> str:
    """Every message with its length on the air and the first sentence about it."""
    text = ["| id | message | bytes on the air | what |", "|---|---|---|---|"]
    for spec in sorted(wire.SPECS, key=lambda spec: spec.msgid):
        name, most = fanet.mavlink_map[spec.msgid].msgname, spec.layout.size + wire.OVERHEAD
        least = SHORTER.get(name, "")
        first = re.split(r"(?<=\w)[.;] ", f"{entries[name].findtext('description')} ")[0]
        text.append(f"| {spec.msgid} | `{name}` | {least}{most} | {first} |")
    return "\n".join(text) + "\n"


def pages(folder: Path) -> dict[Path, str]:
    """Each page with its tables; raises ValueError if a message has none, or two."""
    entries = {
        entry.get("name", ""): entry
        for entry in ET.parse(ROOT / "fanet_mw/dialect/fanet.xml").iter("message")  # noqa: S314 - our own file
    }
    tables = {
        name: described(spec, entries[name]) for spec in wire.SPECS for name in [fanet.mavlink_map[spec.msgid].msgname]
    }
    tables["every_message"] = listed(entries)
    texts = {folder / name: (folder / name).read_text(encoding="utf-8") for name in PAGES}
    found = [name for text in texts.values() for _, name, _ in PART.findall(text)]
    if sorted(found) != sorted(tables):
        raise ValueError(f"without a table, or with two: {sorted(set(tables) ^ set(found)) or found}")
    return {page: PART.sub(lambda part: part[1] + tables[part[2]] + part[3], text) for page, text in texts.items()}


def main(arguments: Sequence[str], *, folder: Path = ROOT / "docs" / "reference") -> int:
    """Write the tables, or with --check say which page is not what would be written."""
    return write_or_check(arguments, script=Path(__file__).name, wanted=lambda: pages(folder))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
