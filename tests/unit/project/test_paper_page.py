"""The page of the paper's claims is what the figures kept beside it say."""

import csv
import json
import runpy

import pytest
from test_documents import ROOT

from sim.figures.all_figures import FIGURES

PICTURES = ROOT / "docs" / "results" / "pictures"
KEPT = {path.stem: json.loads(path.read_text("utf-8")) for path in sorted(PICTURES.glob("*.json"))}


def test_the_page_is_what_the_kept_verdicts_say() -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "generate_paper_page.py"))
    assert script["main"](["--check"]) == 0


@pytest.mark.parametrize("name", KEPT)
def test_every_kept_figure_has_its_picture_and_its_numbers(name: str) -> None:
    assert name in {recipe.name for recipe in FIGURES.values()}
    assert (PICTURES / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    with (PICTURES / f"{name}.csv").open() as file:
        assert sum(1 for _ in csv.DictReader(file)) > 1
    assert KEPT[name]["failed"] == 0


@pytest.mark.parametrize("name", KEPT)
def test_where_a_kept_verdict_differs_from_the_paper_a_reason_is_shown(name: str) -> None:
    for claim in KEPT[name]["claims"]:
        assert claim["verdict"] != "differs" or any(reason["shown"] for reason in claim["reasons"]), claim["claim"]
