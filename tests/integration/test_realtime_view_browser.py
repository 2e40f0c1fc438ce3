"""The pages in a browser, where there is a headless Chromium: what is clicked is selected, moved and cut."""

import hashlib
import json
import math
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fanet_mw.units import S
from sim.cli.app import app
from sim.scenarios.catalog import text_of
from sim.view.server import EYE, GOAL

CHROMIUM = shutil.which("chromium-headless-shell") or shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt install chromium-headless-shell"),
    pytest.mark.slow,
    pytest.mark.timeout(300),
    pytest.mark.filterwarnings("ignore"),  # of playwright's event loop
]
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
PATIENCE_MS = 60_000


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        yield opened
        opened.close()


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A page that fails the test if it asks anybody but this machine."""
    opened = browser.new_page(viewport={"width": 1200, "height": 760})
    outside: list[str] = []
    local = ("http://127.0.0.1", "ws://127.0.0.1", "blob:", "data:", "file:")
    opened.on("request", lambda asked: None if asked.url.startswith(local) else outside.append(asked.url))
    yield opened
    opened.close()
    assert outside == []


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("browsed") / "run"
    assert app(["simulate", "quick", "--out", str(out), "--pcap", "--json"], result_action="return_value") == 0
    return out


@pytest.fixture
def start() -> Iterator[Callable[..., str]]:
    """Starts `fanet ...` and returns the address of its page."""
    running: list[subprocess.Popen[str]] = []

    def begin(*words: str) -> str:
        process = subprocess.Popen([sys.executable, "-m", "fanet_mw", *words], stderr=subprocess.PIPE, text=True)
        running.append(process)
        assert process.stderr is not None
        for line in process.stderr:
            if found := re.search(r"http://127\.0\.0\.1:\d+", line):
                return found.group()
        raise AssertionError("no page was served")

    yield begin
    for process in running:
        process.terminate()
        process.wait(30)


def wait_for(what: Callable[[], bool], *, seconds: float = 60.0) -> None:
    end_s = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end_s, "it did not come"
        time.sleep(0.3)


def share(page: Any) -> float | None:
    found = re.search(r"delivered lately\s*([\d.]+) % of packets", page.inner_text("body"))
    return float(found.group(1)) if found else None


def on_screen(page: Any, at: np.ndarray, half_m: float) -> tuple[float, float]:
    """Where a place is drawn, by the first camera of the view (`look_over`)."""
    eye = np.array(EYE) * half_m
    ahead = np.array(GOAL) * half_m - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0, 0, 1])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    seen = at - eye
    box = page.locator("canvas").first.bounding_box()
    scale = box["height"] / 2 / math.tan(math.radians(45) / 2) / (seen @ ahead)
    return (
        box["x"] + box["width"] / 2 + scale * (seen @ right),
        box["y"] + box["height"] / 2 - scale * (seen @ up),
    )


def test_a_uav_that_is_clicked_is_shown_and_the_slider_moves_time(
    page: Any, start: Callable[..., str], folder: Path
) -> None:
    page.goto(start("replay", str(folder), "--start", "1"))
    page.get_by_text("delivered lately").first.wait_for(timeout=PATIENCE_MS)
    page.get_by_role("button", name="play").click()  # pause
    time_box = page.get_by_role("textbox").first
    time_box.fill("9")
    time_box.press("Enter")
    wait_for(lambda: "9.0 s of 20 s" in page.inner_text("body"))
    time.sleep(1.5)  # the scene is drawn after the panel
    now_s = 9.0
    posed = [json.loads(line)[1:] for line in (folder / "trace.jsonl").open() if line.startswith('["posed"')]
    track = {t_ns / 1e9: np.array(at) for t_ns, node, *at in posed if node == 9}
    page.mouse.click(*on_screen(page, track[now_s], half_m=400.0))
    page.get_by_role("tab", name="UAV").click()
    wait_for(lambda: re.search(r"UAV 9\s", page.inner_text("body")) is not None)
    assert "neighbors" in page.inner_text("body")
    page.get_by_role("tab", name="Air").click()
    page.get_by_label("watch the air").first.click()  # while time stands
    wait_for(lambda: re.search(r"own packets\s+\d+\s+[\d.]+ %", page.inner_text("body")) is not None)
    page.get_by_role("tab", name="UAV").click()
    time_box.fill("15")
    time_box.press("Enter")
    wait_for(lambda: "15.0 s of 20 s" in page.inner_text("body"))


def test_cut_in_the_page_lets_deliveries_fall_in_the_panel(page: Any, start: Callable[..., str]) -> None:
    page.goto(start("launch", "quick", "--duration", "900", "--view"))
    page.get_by_text("delivered lately").first.wait_for(timeout=PATIENCE_MS)
    wait_for(lambda: (share(page) or 0) > 90)
    page.get_by_role("tab", name="Act").click()
    page.get_by_role("button", name="cut a head's radio").click()
    page.get_by_role("tab", name="Swarm").click()
    wait_for(lambda: (share(page) or 100) < 85)
    page.get_by_role("tab", name="Events").click()
    wait_for(lambda: "radio fault cut" in page.inner_text("body"))


SMALL = ("nodes.count=9", "world.area_m=400", "mission.survivors=2", "duration_s=900", "time_scale=0.5")


def test_every_action_says_and_does_what_it_is_called(page: Any, start: Callable[..., str]) -> None:
    """Each button of the panel, on a search of nine UAVs."""

    def says(*texts: str) -> None:
        for text in texts:
            wait_for(lambda text=text: re.search(text, page.inner_text("body")) is not None)  # type: ignore[misc]

    def press(button: str, *texts: str) -> None:
        page.get_by_role("button", name=button, exact=True).click()
        says(*texts)

    page.goto(start("launch", "rescue", "--view", "--set", *SMALL))
    page.get_by_text("delivered lately").first.wait_for(timeout=PATIENCE_MS)
    page.get_by_role("tab", name="UAV").click()
    page.locator("input[value='none']").first.click()
    page.get_by_role("option", name="5", exact=True).first.click()
    says(r"UAV 5\s+role|UAV 5\s+mode")
    page.mouse.click(*on_screen(page, np.array([100.0, -100.0, 0.0]), half_m=200.0))
    for folder in ("send it", "its link to another"):
        page.get_by_text(folder, exact=True).click()
    press("send it to the mark", r"UAV 5 sent to \d+ m E")
    press("call it home", "UAV 5 sent home")
    press("release it", "UAV 5 released")
    press("degrade the link", "link 5 to 1 cut")
    press("cut its radio", "UAV 5: radio off")
    page.get_by_role("tab", name="Act").click()
    press("jam at the mark, or about the UAV", "jammed 150 m about")
    press("end all faults", "all faults end")
    press("let that UAV crash", r"UAV \d crashes")
    press("pause", "the clock stands", ", paused")
    press("run", "clock at 0.5")
    page.get_by_role("tab", name="Events").click()
    says("crash", "jam", "cut", "degrade")


def test_one_file_plays_without_a_network(page: Any, folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "run.html"
    assert app(["replay", str(folder), "--html", str(path)], result_action="return_value") == 0
    page.goto(path.as_uri())
    page.locator("canvas").first.wait_for(timeout=PATIENCE_MS)
    pictures: set[bytes] = set()

    def plays() -> bool:
        pictures.add(page.screenshot(timeout=2 * PATIENCE_MS))
        return len(pictures) >= 2

    wait_for(plays, seconds=180)


def test_a_find_a_lost_head_and_a_broken_bound_are_jumped_to(
    page: Any, start: Callable[..., str], tmp_path: Path
) -> None:
    folder, scenario = tmp_path / "run", tmp_path / "falls.toml"
    small = ("nodes.count=9", "world.area_m=400", "mission.survivors=2", "duration_s=60", "routing.protocol=clustered")
    text = text_of("rescue")
    scenario.write_text(f'{text}\n[[faults]]\nkind = "crash"\nnode = 1\nat_s = 20\n')
    words = ["simulate", str(scenario), "--set", *small, "--out", str(folder), "--json"]
    assert app(words, result_action="return_value") == 0
    trace = folder / "trace.jsonl"
    told = [json.loads(line) for line in trace.open()]
    _, t_ns, _, origin, seq, delay_ns, *_ = next(one for one in told if one[0] == "delivered" and one[1] > 30 * S)
    with trace.open("a") as file:  # a bound that was not kept
        file.write(json.dumps(["bound_stated", t_ns - delay_ns, origin, seq, delay_ns - 1]) + "\n")
    summary = json.loads((folder / "summary.json").read_text())
    data = trace.read_bytes()
    summary["files"]["trace.jsonl"] = {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    (folder / "summary.json").write_text(json.dumps(summary))
    found_s = next(one[1] / S for one in told if one[0] == "confirmed")
    head_s = next(one[1] / S for one in told if one[0] == "role_changed" and one[3] == "head" and one[1] > 20 * S)

    page.goto(start("replay", str(folder), "--start", "1"))
    page.get_by_text("delivered lately").first.wait_for(timeout=PATIENCE_MS)
    page.get_by_role("button", name="play").click()  # pause
    page.get_by_role("tab", name="Events").click()
    chosen = "choose an event"
    for at_s, what in ((found_s, "confirms"), (head_s, "becomes head"), (t_ns / S, "broken bound")):
        name = re.compile(rf"^{at_s:.1f} s .*{what}")
        page.locator(f"input[value='{chosen}']").first.click()
        page.get_by_role("option", name=name).first.click()
        wait_for(lambda at_s=at_s: f"{at_s:.1f} s of 60 s" in page.inner_text("body"))  # type: ignore[misc]
        chosen = page.locator("input[value*=' s  ']").first.input_value()
        assert name.search(chosen)
    page.get_by_role("button", name="earlier", exact=True).click()
    wait_for(lambda: f"{t_ns / S:.1f} s of 60 s" not in page.inner_text("body"))
    page.get_by_role("button", name="later", exact=True).click()
    wait_for(lambda: f"{t_ns / S:.1f} s of 60 s" in page.inner_text("body"))
