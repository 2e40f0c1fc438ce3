"""Verdicts of claims, figures from real (tiny) sweeps, and the pages made of them."""

import csv
import json
import math
import re
import statistics
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from emulator.pcap_file import PcapFile
from fanet_mw.errors import ConfigError
from sim.cli.app import app
from sim.figures import beyond_paper, figure11, figure12
from sim.figures.all_figures import FIGURES, chosen
from sim.figures.finished_runs import Runs, differences, keep, max_per_seed, mean_per_seed, read_kept
from sim.figures.paper_claims import Claim, Finding, Reason, Statement, Verdict, above, alike, below
from sim.figures.recipe import render
from sim.figures.rescue import confirmed_s, loss_share
from sim.figures.statistics import DISTANCE, SHARE, interval, quantile_975
from sim.figures.style import beside, canvas, legend_above, reaches, spaced
from sim.report.page import write
from sim.results.files import finish
from sim.run.virtual import EPOCH_UNIX_NS, simulate
from sim.scenarios import catalog
from sim.sweep import spec
from sim.sweep.one_run import carry_out
from sim.sweep.provenance import code
from sim.sweep.store import table_of
from sim.sweep.tasks import tasks_of


def statement(values: list[float], side: str, threshold: float) -> Statement:
    return Statement("it", values, side, threshold)


def test_an_interval_is_that_of_student() -> None:
    """Five values with mean 3 and standard deviation 1.581: half width 2.776 x 1.581 / sqrt(5) = 1.963."""
    found = interval([1, 2, 3, 4, 5])
    assert found.mean == 3
    assert found.high - 3 == pytest.approx(1.963, abs=1e-3)
    assert 3 - found.low == pytest.approx(1.963, abs=1e-3)
    assert interval([7.0]).low == -math.inf
    assert math.isnan(interval([]).mean)
    assert interval([1280.4, 1280.4]).text("ms") == "1280 ms [1280, 1280]"
    assert interval([0.01234]).text() == "0.0123 [one run]"


def test_an_interval_of_few_seeds_ends_where_the_quantity_does() -> None:
    found = interval([1.0, 1.0, 0.7], SHARE)
    assert found.high == 1.0
    assert found.low == interval([1.0, 1.0, 0.7]).low, "the other end keeps its place"
    assert interval([0.1, 0.1, 2.0], DISTANCE).low == 0.0
    assert interval([0.4], SHARE)[1:3] == SHARE


def test_an_interval_of_ten_seeds_holds_nothing_beyond_what_was_seen_and_is_as_skew_as_that() -> None:
    """Nine seeds in which all 45 turn, and one in which nobody does: the mean is at most 45."""
    found = interval([45.0] * 9 + [0.0])
    assert 0.0 <= found.low < 36.0
    assert found.high == 45.0
    assert found == interval([45.0] * 9 + [0.0]), "it is the same each time"


def test_an_interval_of_many_normal_values_is_that_of_student() -> None:
    """On either side; of one sample it differs, of many in the mean it hardly does."""
    ratios = []
    for values in np.random.default_rng(3).normal(5.0, 2.0, (40, 12)).tolist():
        half = quantile_975(11) * statistics.stdev(values) / math.sqrt(12)
        found = interval(values)
        ratios.append([(found.mean - found.low) / half, (found.high - found.mean) / half])
    assert np.mean(ratios, axis=0) == pytest.approx([1.0, 1.0], abs=0.04)


def test_from_eight_values_on_an_interval_lies_within_them() -> None:
    assert interval([45.0] * 7 + [0.0]).high == 45.0
    assert interval([45.0] * 6 + [0.0]).high > 45.0


def test_what_is_alike_differs_by_less_than_the_limit_on_either_side() -> None:
    for values, findings in (
        ([-0.1, 0.0, 0.1], [Finding.HOLDS, Finding.HOLDS]),
        ([1.0, 1.0, 1.1], [Finding.HOLDS, Finding.FAILS]),
        ([-1.0, -1.0, -1.1], [Finding.FAILS, Finding.HOLDS]),
    ):
        assert [statement.finding for statement in alike("difference", values, 0.5)] == findings


def test_a_rival_that_was_not_flown_leaves_a_claim_open() -> None:
    claim = Claim(
        0, "ours is best", [above("ours minus flooding", [1.0, 1.1], 0.0), above("ours minus paper", [], 0.0)]
    )
    assert claim.verdict is not Verdict.AGREES
    assert "no run" in claim.statements[1].text()


@pytest.mark.slow
def test_figure_12_with_two_rates_and_two_methods_counts_its_panels_and_names_no_other_method() -> None:
    kept = read_kept(Path(__file__).parents[3] / "docs/results/sweeps", "fig12", "full")
    assert kept is not None
    few = [
        row["case"] in ("flooding", "paper") and row["mission.report_interval_s"] in (1, 0.1)
        for row in kept.select(["case", "mission.report_interval_s"]).to_pylist()
    ]
    figure = FIGURES["12"].draw(Runs(kept.filter(few))).figure
    letters = [axes.get_title()[:3] for axes in figure.axes if axes.get_title()]
    assert letters == ["(a)", "(b)", "(c)", "(d)"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["plain flooding", "the paper's method, 4 clusters, 5 s"]


def test_a_legend_that_is_wider_than_its_figure_takes_more_rows() -> None:
    figure, (axes, _) = canvas(2)
    for number in range(7):
        axes.plot([0, 1], label=f"a protocol with a long name, number {number}")
    legend_above(figure, axes)
    (legend,) = figure.legends
    assert len(legend.get_texts()) == 7
    assert legend.get_window_extent().width <= figure.bbox.width


def test_a_legend_that_does_not_fit_in_any_way_is_drawn_all_the_same() -> None:
    figure, (axes,) = canvas(1)
    axes.plot([0, 1], label="a name that is wider than the whole figure " * 10)
    legend_above(figure, axes)
    assert len(figure.legends) == 1


def test_quantiles_fall_towards_the_normal_one() -> None:
    found = [quantile_975(freedom) for freedom in range(1, 200)]
    assert found == sorted(found, reverse=True)
    assert quantile_975(40) == pytest.approx(2.021, abs=0.01)
    assert quantile_975(10_000) == pytest.approx(1.960, abs=0.001)


@pytest.mark.parametrize(
    ("values", "side", "finding"),
    [
        ([2.0, 2.1, 1.9], "above", Finding.HOLDS),
        ([2.0, 2.1, 1.9], "below", Finding.FAILS),
        ([0.0, 0.1, -0.1], "above", Finding.FAILS),
        ([0.0, 0.1, -0.1], "below", Finding.HOLDS),
        ([0.0, 2.0, 1.0], "above", Finding.OPEN),
        ([5.0], "above", Finding.OPEN),
        ([], "above", Finding.OPEN),
        ([1.0, 1.0], "below", Finding.HOLDS),
    ],
)
def test_a_statement_holds_only_with_its_whole_interval(values: list[float], side: str, finding: Finding) -> None:
    assert statement(values, side, 1.0).finding is finding


def test_a_claim_agrees_when_all_holds_differs_when_all_fails_and_is_partly_so_otherwise() -> None:
    holds, fails, is_open = (statement(values, "above", 1.0) for values in ([2.0, 2.0], [0.0, 0.0], [0.0, 2.0]))
    assert Claim(8, "it", [holds, holds]).verdict is Verdict.AGREES
    assert Claim(8, "it", [fails, fails]).verdict is Verdict.DIFFERS
    for mixed in ([holds, fails], [holds, is_open], [fails, is_open], [is_open]):
        assert Claim(8, "it", mixed).verdict is Verdict.PARTLY


def test_a_reason_is_shown_only_when_every_statement_of_its_experiment_holds() -> None:
    holds, fails, is_open = (above("it", values, 1.0) for values in ([2.0, 2.0], [0.0, 0.0], {1: 0.0, 2: 2.0}))
    assert Reason("so", [holds, holds]).shown
    for others in ([fails], [is_open], [holds, fails], [holds, is_open], []):
        assert not Reason("so", others).shown
    assert below("it", {1: 0.0, 2: 0.5}, 1.0, "s").text() == "it: 0.25 s [-2.93, 3.43], claimed below 1 s: open"


def test_a_page_says_of_a_reason_what_shows_it_or_that_nothing_does(nine, tmp_path) -> None:
    table, _, _ = nine
    reasons = [
        Reason("Air.", [above("air", [2.0, 2.0], 1.0)], "the limit."),
        Reason("Luck.", [above("luck", [0.0, 2.0], 1.0)]),
    ]
    claims = [Claim(9, "It falls.", [above("it", [2.0, 2.0], 1.0)], reasons)]
    render(replace(FIGURES["9"], claims=lambda _: claims), table, tmp_path)
    _, markdown = (path.read_text() for path in write([tmp_path], tmp_path))
    assert "Air. (air: 2 [2, 2], expected above 1: holds.) Set after such runs had been seen: the limit." in markdown
    assert markdown.count("Set after") == 1
    assert "Supposed, but not shown by these runs: Luck. (luck: 1 [" in markdown
    assert markdown.count("not shown") == 1


def test_differences_are_taken_seed_by_seed() -> None:
    assert differences({1: 5.0, 2: 7.0, 3: 1.0}, {2: 1.0, 1: 2.0}) == [3.0, 6.0]
    assert mean_per_seed({1: 1.0, 2: 3.0}, {1: 3.0}) == {1: 2.0}
    assert max_per_seed({1: 1.0, 2: 3.0}, {1: 3.0, 2: 0.0}) == {1: 3.0, 2: 3.0}


def test_a_bar_ends_at_what_there_can_be_and_one_run_has_none() -> None:
    wide, narrow = interval([0.1, 0.99]), interval([0.5, 0.5])
    assert wide.low < 0
    assert wide.high > 1
    down, up = reaches([wide, narrow, interval([0.3])], most=1.0)
    assert down == pytest.approx([wide.mean, 0, 0])
    assert up == pytest.approx([1 - wide.mean, 0, 0])


def test_marks_at_one_place_stand_beside_each_other_about_it() -> None:
    assert [beside(10, n, 3, log=False, apart=0.5) for n in range(3)] == [9.5, 10, 10.5]
    assert [beside(10, n, 3, log=True, apart=1.0) for n in range(3)] == [5, 10, 20]


def test_ticks_that_would_write_over_each_other_are_left_out() -> None:
    assert spaced([1, 2, 5, 10, 20, 30, 44]) == [1, 5, 10, 20, 30, 44]
    assert spaced([1, 2, 3, 50]) == [1, 3, 50]
    assert spaced([7]) == [7]


def test_a_search_that_did_not_confirm_so_many_ended_with_the_run() -> None:
    row = {"mission.time_to_confirm_s": [30.0, 10.0, 20.0], "mission.survivors": 6.0, "duration_s": 80.0}
    assert confirmed_s(row, 0.5) == 30
    assert confirmed_s(row, 1.0) == 80
    assert confirmed_s({**row, "mission.time_to_confirm_s": None}, 0.5) == 80
    assert loss_share('[{at_s = 0.0, kind = "degrade", loss_db = 0.0, loss_share = 0.8}]') == 0.8
    assert loss_share("[]") == 0


def test_half_of_an_odd_swarm_is_more_than_half_of_it_less_one() -> None:
    row = {"nodes": 5.0, "first_approach_s": [4.0, 1.0, 3.0]}
    assert figure12._half_s(row) == 4
    assert figure12._half_s({**row, "first_approach_s": [1.0, 3.0]}) is None


def test_a_figure_that_there_is_not_is_an_error() -> None:
    assert next(iter(chosen(["9", "all"]))).name == "figure-9"
    assert len(chosen([])) == len(FIGURES)
    with pytest.raises(ConfigError, match="figure '7': must be one of 8, 9, 10"):
        chosen(["7"])


def tiny(name: str, *, seeds: int = 2, **changes: object):
    """A shipped sweep with few nodes and short runs, carried out here."""
    found = spec.find(name)
    grid = {key: changes.get(key, [values[0], values[-1]]) for key, values in found.grid.items()}
    small = {"nodes.count": 9, "duration_s": 4, "warmup_s": 1, "drain_s": 1, "traffic.sources": 4, **changes}
    if "traffic" in found.set:  # classes of traffic, as a list
        del small["traffic.sources"]
    small = {key: value for key, value in small.items() if key not in grid}
    cases = tuple(
        case.model_copy(update={"grid": {key: grid.get(key, values) for key, values in case.grid.items()}})
        for case in found.case
    )
    sweep = found.model_copy(update={"seeds": seeds, "grid": grid, "set": {**found.set, **small}, "case": cases})
    rows = [(task, carry_out(task)) for task in tasks_of(sweep)]
    assert [done.error for _, done in rows if done.failed] == []
    return table_of(rows, sweep.varied())


@pytest.fixture(scope="module")
def nine(tmp_path_factory):
    table = tiny("fig9", **{"traffic.sources": [1, 8], "traffic.interval_s": [1, 0.05]})
    folder = tmp_path_factory.mktemp("figures")
    return table, folder, render(FIGURES["9"], table, folder)


def test_a_figure_has_its_picture_its_numbers_and_its_verdicts_beside_each_other(nine) -> None:
    table, folder, claims = nine
    assert (folder / "figure-9.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (folder / "figure-9.svg").read_text()
    with (folder / "figure-9.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["panel"] == "pdr"]
    dense = [row for row in table.to_pylist() if (row["traffic.sources"], row["traffic.interval_s"]) == (8, 0.05)]
    runs = [row for row in dense if row["case"] == "formation"]
    [drawn] = [row for row in rows if (row["motion"], row["sources"], row["interval_s"]) == ("formation", "8", "0.05")]
    assert float(drawn["mean"]) == pytest.approx(statistics.mean(row["pdr"] for row in runs))
    about = json.loads((folder / "figure-9.json").read_text())
    assert [claim["verdict"] for claim in about["claims"]] == [claim.verdict for claim in claims]
    assert about["runs"] == 16


def test_the_same_table_gives_the_same_picture(nine, tmp_path) -> None:
    table, folder, _ = nine
    render(FIGURES["9"], table, tmp_path)
    for name in ("figure-9.svg", "figure-9.csv", "figure-9.json"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_a_kept_table_gives_the_same_figure_and_verdicts(nine, tmp_path) -> None:
    table, folder, claims = nine
    assert read_kept(tmp_path, "fig9", "quick") is None
    keep(table, tmp_path, "fig9", "quick")
    kept = read_kept(tmp_path, "fig9", "quick")
    assert kept is not None
    assert render(FIGURES["9"], kept, tmp_path) == claims
    for kind in ("csv", "json", "png"):
        assert (tmp_path / f"figure-9.{kind}").read_bytes() == (folder / f"figure-9.{kind}").read_bytes(), kind
    assert set(table.column_names) - set(kept.column_names) == {"summary", "trace_sha256"}
    (tmp_path / "fig9-quick.parquet").write_bytes(b"PAR1, and no more")
    with pytest.raises(ConfigError, match=r"fig9-quick\.parquet: cannot be read"):
        read_kept(tmp_path, "fig9", "quick")


def test_kept_tables_are_drawn_by_the_command_and_missing_ones_are_named(
    nine, tmp_path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, folder, _ = nine
    older = table.set_column(table.column_names.index("code"), "code", [["0.0.9+0ld"] * 3 + [code()] * 13])
    keep(older, tmp_path / "kept", "fig9", "quick")
    words = ["figures", "9", "--out", str(tmp_path / "drawn"), "--kept", str(tmp_path / "kept")]
    with pytest.raises(ConfigError, match="--kept is for --draw-only"):
        app(words, result_action="return_value", exit_on_error=False)
    assert app([*words, "--draw-only"], result_action="return_value") == 0
    said = capsys.readouterr().out
    assert "figure-9: 3 of 16 finished runs are of other code (3 of 0.0.9+0ld; this is" in said
    assert (tmp_path / "drawn" / "figure-9.png").read_bytes() == (folder / "figure-9.png").read_bytes()
    about = json.loads((tmp_path / "drawn" / "figure-9.json").read_text())
    assert about["runs_by_code"] == {"0.0.9+0ld": 3, code(): 13}
    _, markdown = (path.read_text() for path in write([tmp_path / "drawn"], tmp_path / "drawn"))
    assert f"the runs are of 2 codes: 0.0.9+0ld (3 runs), {code()} (13 runs)." in markdown
    assert "`fanet figures 9 --quick --rerun-older` makes them of one." in markdown
    assert app([*words, "10", "--draw-only"], result_action="return_value") == 1
    assert "has no table of it: fig10" in " ".join(capsys.readouterr().out.split())


def test_a_figure_of_single_runs_has_a_page_although_no_interval_ends(nine, tmp_path) -> None:
    table, _, _ = nine
    render(FIGURES["9"], table.filter([seed == 1 for seed in table.column("seed").to_pylist()]), tmp_path)
    _, markdown = (path.read_text() for path in write([tmp_path], tmp_path))
    assert "[one run], claimed above 0.02: open" in markdown


def test_the_interval_of_a_difference_holds_its_mean_on_either_side_of_0() -> None:
    def row(case: str, seed: int, within: float) -> dict[str, object]:
        found = {"pdr": 1.0, "bound.within_share": within, "delay_ms.p95": 100.0}
        return {"case": case, "seed": seed, "status": "ok", "code": "0", **found}

    rows = [row(case, seed, within) for seed in (1, 2, 3) for case, within in (("ours", 0.9), ("ours, at rest", 0.8))]
    claim = figure11._motion_does_not_matter(Runs(pa.Table.from_pylist(rows)))
    assert claim.verdict is Verdict.AGREES
    within = claim.statements[1].interval
    assert within.low <= within.mean <= within.high < 0


def test_the_air_that_a_delivery_takes_does_not_depend_on_how_long_the_swarm_warms_up() -> None:
    """A packet of 1024 B at 11 Mb/s takes 1 ms of air, and each of two nodes within reach sends it once: for two
    packets one is delivered to the mean node, which has heard or sent four frames.
    """
    found = []
    for warmup_s in (1, 5):
        length = {"duration_s": warmup_s + 4, "warmup_s": warmup_s, "drain_s": 1}
        sweep = spec.Sweep(base="flooding", set={**length, "nodes.count": 2, "traffic.sources": 1})
        sweep = sweep.model_copy(update={"set": {**sweep.set, "traffic.interval_s": 0.02}})
        rows = [(task, carry_out(task)) for task in tasks_of(sweep)]
        (row,) = Runs(table_of(rows, sweep.varied())).rows
        found.append(beyond_paper._ms_per_delivery(row))
    assert found == pytest.approx([4.0, 4.0], rel=0.1)


def test_failed_runs_are_in_no_figure(nine) -> None:
    table, _, _ = nine
    status = table.column("status").to_pylist()
    changed = table.set_column(table.column_names.index("status"), "status", [["failed", *status[1:]]])
    runs = Runs(changed)
    assert (len(runs.rows), runs.failed) == (len(status) - 1, 1)


def test_what_is_said_beyond_the_paper_is_told_apart_from_its_claims(nine, tmp_path) -> None:
    table, _, _ = nine
    holds = [above("it", [2.0, 2.0], 1.0)]
    render(
        replace(FIGURES["9"], claims=lambda _: [Claim(9, "It falls.", holds), Claim(0, "Ours stays.", holds)]),
        table,
        tmp_path,
    )
    _, markdown = (path.read_text() for path in write([tmp_path], tmp_path))
    assert "Of 1 claims: 1 agree, 0 partly, 0 differ." in markdown
    assert "| figure-9 | Ours stays. | agrees |" in markdown
    assert "| (Beyond the paper) Ours stays. |" in markdown


def test_a_page_needs_nothing_else_and_has_every_verdict(nine, tmp_path) -> None:
    table, folder, claims = nine
    html, markdown = (path.read_text() for path in write([folder], folder))
    assert html.count("data:image/png;base64,") == 1
    assert re.findall(r"(?:src|href)=\"(?!data:)", html) == []
    for claim in claims:
        assert claim.claim in markdown
        assert f'<td class="{claim.verdict}">{claim.verdict}</td>' in html
    assert "](figure-9.png)" in markdown
    assert f"| figure-9 | quick | {table.num_rows} | 2 | {code()} |" in markdown
    (tmp_path / "runs.parquet").touch()
    with pytest.raises(ConfigError, match=r"but a sweep, whose table fanet_mw\.results\.read gives"):
        write([tmp_path], tmp_path)
    with pytest.raises(ConfigError, match=r"holds neither figures .* --out\)$"):
        write([folder / "sweeps"], folder)


@pytest.mark.parametrize("scenario", ["clusters", "quick"])
@pytest.mark.slow
def test_a_run_has_a_page_with_its_delays_links_and_mission(scenario: str, tmp_path: Path) -> None:
    keys = [
        "nodes.count=9",
        "world.engine=kinematic",
        "duration_s=14",
        "warmup_s=8",
        "drain_s=1",
        "traffic.sources=all",
    ]
    keys += ["clusters.count=8"] if scenario == "clusters" else []
    chosen = catalog.find(scenario, keys)
    with PcapFile(tmp_path / "air.pcap", chosen.radio) as file:
        file.pcap.epoch_unix_ns = EPOCH_UNIX_NS
        finish(simulate(chosen, capture=file.pcap), out=tmp_path)
    html, markdown = (path.read_text() for path in write([tmp_path], tmp_path))
    pictures = {path.stem.removeprefix(f"{scenario}-1-") for path in (tmp_path / "pictures").glob("*.png")}
    of_mission = {"mission", "tracks"} if scenario == "quick" else set()
    assert pictures == {"delays", "delivery", "links", "slots", "air"} | of_mission
    assert "| relayed |" in markdown
    assert "A greedy connected dominating set of the links has" in markdown
    for words in ("Mission", "survivors confirmed", "area covered"):
        assert (words in markdown) == (scenario == "quick"), "a run without a mission has no section about one"
    kept = re.search(r"Of (\d+) packets of (heads|nodes with turns), (\d+) were let out", markdown)
    assert kept is not None, "the protocol has slots, or turns"
    assert kept[1] == kept[3] != "0"
    assert html.count("data:image/png;base64,") == len(pictures)
    assert ("delivered within their bound" in markdown) == (scenario == "clusters")


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", sorted(set(FIGURES) - {"9", "realtime"}))
def test_every_figure_is_drawn_from_its_shipped_sweep(name: str, tmp_path: Path) -> None:
    recipe = FIGURES[name]
    changes: dict[str, object] = {"nodes.count": 45, "duration_s": 3, "traffic.sources": 8}
    if name == "mission":
        changes = {"nodes.count": 12, "duration_s": 14}
    if name == "reports":
        changes = {"nodes.count": 45, "duration_s": 14, "mission.report_interval_s": [2, 0.5, 0.1]}
    if name == "ablation":
        changes = {"nodes.count": 45, "duration_s": 10, "warmup_s": 6, "drain_s": 2}
    if name == "size":
        changes["nodes.count"] = [9, 16]
    if name == "clocks":  # of which every case must deliver something
        changes.update({"duration_s": 12, "warmup_s": 8})
    if name == "11":  # whose load, in flight, must find the timetable there: before, it is flooded without bounds
        changes.update({"duration_s": 31, "warmup_s": 25})
    if name == "12":
        changes["world.engine"] = "kinematic"
    table = tiny(recipe.sweep, seeds=1 if name == "11" else 2, **changes)
    claims = render(recipe, table, tmp_path)
    assert (tmp_path / f"{recipe.name}.png").exists()
    assert all(statement.values or claim.figure == 12 for claim in claims for statement in claim.statements)
