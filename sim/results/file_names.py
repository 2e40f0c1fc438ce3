"""The names of the files that a run and its page write into its folder."""

from pathlib import Path
from typing import Final

SUMMARY_FILE: Final = "summary.json"
SCENARIO_FILE: Final = "scenario.toml"
REPORTS_FILE: Final = "reports.json"
LINKS_FILE: Final = "links.json"
TRACE_FILE: Final = "trace.jsonl"
TLOG_FILE: Final = "mavlink.tlog"
RUN_FILES: Final = (SUMMARY_FILE, SCENARIO_FILE, REPORTS_FILE, LINKS_FILE, TRACE_FILE, TLOG_FILE)
"""All of them, besides captures of the radio and the files of a page."""
RESERVED: Final = {".summary.json.new": 1 << 14, ".summary.json.last": 1 << 14, ".scenario.toml.new": 1 << 13}
"""Files that keep so much room during a run for what must be written at its end, even if the disk is full by then."""
REPLAY: Final = "replay.html"
PAGES: Final = ("report.html", "report.md", REPLAY)
PICTURES: Final = "pictures"
"""The folder of a run's pictures, beside the page."""
KINDS: Final = ("delays", "delivery", "links", "slots", "air", "mission", "waits", "tracks")
"""What the pictures of a run show; each is a file `SCENARIO-SEED-KIND` in both formats."""
FORMATS: Final = (".png", ".svg")


def pictures(folder: Path) -> list[Path]:
    kinds = tuple(f"-{kind}" for kind in KINDS)
    found = [] if (folder / PICTURES).is_symlink() else sorted((folder / PICTURES).glob("*"))
    return [path for path in found if path.suffix in FORMATS and path.stem.endswith(kinds)]
