"""The names of the files of a page, so that they can be told from all others in a folder."""

from pathlib import Path
from typing import Final

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
