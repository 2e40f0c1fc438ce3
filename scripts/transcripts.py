"""Run the commands of docs/tutorial/*.md and write what they print below them; `--check` compares instead.

A block ```console holds commands behind `$ ` and their output. A block ```python or ```toml is a file, whose name is in
its first line, `# NAME.py`. The commands of a page run one after the other in one empty folder. How long something took
is not compared, and neither are lines that tell progress; pictures (*.svg) are copied beside the page.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = ROOT / "docs" / "tutorial"
BLOCK = re.compile(r"^```(console|python|toml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TIMES = re.compile(
    r"in \d+(?:\.\d+)? s \((?:\d+(?:\.\d+)? x real time|\d+ s of CPU)\)|^\w+: \d+ of \d+ runs, about .* left\n"
    r"|; about .* with \d+ process",
    re.MULTILINE,
)


def played(text: str, folder: Path) -> str:
    """The page with the output of its commands as it is now."""

    def play(block: re.Match[str]) -> str:
        kind, body = block.groups()
        if kind != "console":
            name, _, _ = body.partition("\n")
            (folder / name.removeprefix("# ").strip()).write_text(body, encoding="utf-8")
            return block[0]
        commands = [line.removeprefix("$ ") for line in body.splitlines() if line.startswith("$ ")]
        lines = [line for command in commands for line in (f"$ {command}", *_output(command, folder))]
        return "\n".join(["```console", *lines, "```"])

    return BLOCK.sub(play, text)


def _output(command: str, folder: Path) -> list[str]:
    environment = {**os.environ, "COLUMNS": "100", "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg", "TERM": "dumb"}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}"
    ended = subprocess.run(  # noqa: S603  (commands of our own pages)
        ["/bin/bash", "-c", command], cwd=folder, env=environment, text=True, timeout=300, check=False,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    return [line.rstrip() for line in ended.stdout.strip("\n").splitlines()]


def main(arguments: Sequence[str]) -> int:
    """Write the pages, or with --check say whether the commands still print what is there."""
    if arguments not in ([], ["--check"]):
        sys.stderr.write(f"usage: transcripts.py [--check]; got {' '.join(arguments)}\n")
        return 2
    old = []
    for page in sorted(PAGES.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            now = played(text, Path(folder))
            if arguments:
                old += [] if TIMES.sub("", now) == TIMES.sub("", text) else [page]
                continue
            page.write_text(now, encoding="utf-8")
            for picture in Path(folder).glob("*.svg"):
                shutil.copy(picture, PAGES / picture.name)
    for page in old:
        sys.stderr.write(f"{page}: the commands print something else; run scripts/transcripts.py and check it in\n")
    return 1 if old else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
