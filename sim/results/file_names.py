"""The names of the files that a run writes into its folder."""

from typing import Final

SUMMARY_FILE: Final = "summary.json"
SCENARIO_FILE: Final = "scenario.toml"
"""The resolved scenario."""
REPORTS_FILE: Final = "reports.json"
LINKS_FILE: Final = "links.json"
TRACE_FILE: Final = "trace.jsonl"
TLOG_FILE: Final = "mavlink.tlog"
RUN_FILES: Final = (SUMMARY_FILE, SCENARIO_FILE, REPORTS_FILE, LINKS_FILE, TRACE_FILE, TLOG_FILE)
"""All of them, besides captures of the radio and the files of a page."""
RESERVED: Final = {".summary.json.new": 1 << 14, ".summary.json.last": 1 << 14, ".scenario.toml.new": 1 << 13}
"""Files that keep so much room during a run for what must be written at its end, even if the disk is full by then."""
