#!/usr/bin/env python
"""Takes pictures of what people look at, on a desktop (1440 x 860) and a phone (390 x 844): view, files, report, site.

    scripts/screenshots.py FOLDER OUT [--at 129] [--only scene panel html map report inspect site]

FOLDER is a run of `fanet simulate --out`; OUT gets NAME.png and NAME-phone.png. Needs a headless Chromium, and
playwright of the development group; the site must have been built (scripts/build_site.py).
"""

import argparse
import asyncio
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parents[1]
SCREENS: Final = {"": (1440, 860), "-phone": (390, 844)}
SOFTWARE: Final = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
PATIENCE_MS: Final = 120_000
SITE_PAGES: Final = ("index", "how-to/see-a-swarm", "reference/api")
Look = Callable[[Any, str], None]
"""Looks at a page; the second argument is the ending of the screen's name."""


class Photographer:
    """Opens pages on both screens and keeps pictures of them."""

    def __init__(self, browser: Any, out: Path) -> None:  # noqa: ANN401  (playwright's types)
        self._browser, self.out = browser, out

    def take(self, name: str, address: str, look: Look = lambda _page, _ending: None, *, whole: bool = False) -> None:
        """A picture of a page on each screen, after `look` has waited for it or done something; `whole`: all of it."""
        for ending, (width, height) in SCREENS.items():
            phone = bool(ending)
            page = self._browser.new_page(
                viewport={"width": width, "height": height}, is_mobile=phone, has_touch=phone,
            )  # fmt: skip
            page.goto(address)
            look(page, ending)
            page.screenshot(path=self.out / f"{name}{ending}.png", full_page=whole, timeout=PATIENCE_MS)
            wide = page.evaluate("document.documentElement.scrollWidth")
            print(f"{name}{ending}.png" + (f": {wide} px wide, scrolls sideways" if wide > width else ""))
            page.close()


def without_warning(page: Any) -> None:  # noqa: ANN401
    """Close the notice that nothing is drawn by a graphics card here."""
    notice = page.locator(".mantine-Notification-closeButton")
    if notice.count():
        notice.first.click()
        page.wait_for_timeout(700)


@contextmanager
def served(folder: Path, *words: str) -> Iterator[str]:
    """The address of `fanet replay FOLDER`."""
    command = [sys.executable, "-m", "fanet_mw", "replay", str(folder), *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603  (our own command)
        assert process.stderr is not None, "it is a pipe"
        yield next(found.group() for line in process.stderr if (found := re.search(r"http://127\.0\.0\.1:\d+", line)))
        process.terminate()


def replay(photos: Photographer, folder: Path, at_s: float, tabs: Sequence[str]) -> None:
    """The scene, with these tabs of its panel."""

    def look(page: Any, ending: str, *, tab: str) -> None:  # noqa: ANN401
        page.get_by_text("delivered lately").first.wait_for(timeout=PATIENCE_MS, state="attached")
        page.get_by_role("button", name="play").click()  # pause
        page.wait_for_timeout(4000)
        without_warning(page)
        if tab:
            page.get_by_role("tab", name=tab).click()
            page.wait_for_timeout(1000)
        if tab == "UAV":
            page.locator("input[value='none']").first.click()
            page.get_by_role("option", name="20", exact=True).first.click()
            page.wait_for_timeout(2000)

    with served(folder, "--start", str(at_s)) as address:
        for tab in tabs:
            photos.take(f"replay-{tab.lower()}" if tab else "replay", address, partial(look, tab=tab))


def files(photos: Photographer, folder: Path, at_s: float, *, name: str) -> None:
    """The run as one file: the scene (`html`), or the map (`map`)."""
    path = photos.out / f"{name}.html"
    words = ["replay", str(folder), f"--{name}", str(path)]
    subprocess.run([sys.executable, "-m", "fanet_mw", *words], check=True)  # noqa: S603  (our own command)
    ending = f"#t={at_s:g}" if name == "map" else ""

    def look(page: Any, _ending: str) -> None:  # noqa: ANN401
        page.wait_for_timeout(9000)
        without_warning(page)
        if name == "html":
            page.locator("button").first.click()  # pause, and let the drawing catch up
            page.wait_for_timeout(9000)

    photos.take(f"file-{name}", path.resolve().as_uri() + ending, look)


def report(photos: Photographer, folder: Path) -> None:
    with tempfile.TemporaryDirectory() as out:
        words = ["report", str(folder), "--out", out]
        subprocess.run([sys.executable, "-m", "fanet_mw", *words], check=True)  # noqa: S603  (our own command)
        photos.take("report", (Path(out) / "report.html").as_uri(), whole=True)


class _Silent(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Say nothing."""


def site(photos: Photographer) -> None:
    handler = partial(_Silent, directory=str(ROOT / "site"))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        for page in SITE_PAGES:
            photos.take(
                f"site-{Path(page).name}", f"http://127.0.0.1:{server.server_port}/{page}.html",
                lambda shown, _: shown.wait_for_timeout(1500),
            )  # fmt: skip
        server.shutdown()


def inspect(photos: Photographer, folder: Path) -> None:
    """Each tab of the inspector, as textual draws it."""
    from sim.inspection.inspection import of_folder
    from sim.inspection.screen import Inspector
    from sim.results.run_folder import RunFolder

    async def drawn() -> dict[str, str]:
        app = Inspector(of_folder(RunFolder(folder)), title=folder.name, pump=lambda _: "a recording", live=False)
        found = {}
        async with app.run_test(size=(168, 50)) as pilot:
            for key, name in (("1", "messages"), ("2", "packets"), ("3", "turns"), ("4", "links")):
                await pilot.press(key)
                await pilot.pause(0.5)
                await pilot.press("down", "down", "down")
                await pilot.pause(0.8)
                found[name] = app.export_screenshot()
        return found

    with ThreadPoolExecutor(1) as apart:  # playwright has an event loop on this thread
        drawings = apart.submit(lambda: asyncio.run(drawn())).result()
    for name, drawing in drawings.items():
        path = photos.out / f"inspect-{name}.svg"
        path.write_text(drawing, encoding="utf-8")
        photos.take(f"inspect-{name}", path.resolve().as_uri())
        path.unlink()


def main() -> None:
    from playwright.sync_api import sync_playwright

    flags = argparse.ArgumentParser(description="Pictures of what people look at, on a desktop and on a phone.")
    flags.add_argument("folder", type=Path)
    flags.add_argument("out", type=Path)
    flags.add_argument("--at", type=float, default=129.0, help="the instant that is shown [s]")
    names = ("scene", "panel", "html", "map", "report", "inspect", "site")
    flags.add_argument("--only", nargs="+", choices=names, default=names)
    given = flags.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    chromium = shutil.which("chromium-headless-shell") or shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium, args=SOFTWARE)
        photos = Photographer(browser, given.out)
        takes: dict[str, Callable[[], None]] = {
            "scene": lambda: replay(photos, given.folder, given.at, [""]),
            "panel": lambda: replay(photos, given.folder, given.at, ["UAV", "Events", "Show"]),
            "html": lambda: files(photos, given.folder, given.at, name="html"),
            "map": lambda: files(photos, given.folder, given.at, name="map"),
            "report": lambda: report(photos, given.folder),
            "inspect": lambda: inspect(photos, given.folder),
            "site": lambda: site(photos),
        }
        for name in given.only:
            takes[name]()
        browser.close()


if __name__ == "__main__":
    main()
