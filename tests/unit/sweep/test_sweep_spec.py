"""What a sweep file means, and what is wrong with one, before anything runs."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.errors import ConfigError
from fanet_mw.scenario.config import one_value
from sim.cli.sweep import asked
from sim.sweep import spec
from sim.sweep.tasks import tasks_of
from sim.sweep.toml_values import axis, toml_value

FILE = """
base = "flooding"
seeds = 3
[set]
duration_s = 2
[grid]
traffic.sources = [1, 4]
"nodes.count" = [5, 9]
[[case]]
name = "flooding"
set.routing.protocol = "flooding"
[[case]]
name = "gossip"
set.routing.protocol = "gossip"
grid.routing.gossip_p = [0.5]
[quick]
seeds = [7]
cases = ["gossip"]
grid.traffic.sources = [2]
"""


def test_every_case_is_run_with_every_combination_of_the_grid_and_every_seed() -> None:
    tasks = tasks_of(spec.parse(FILE, source="test"))

    assert len(tasks) == 2 * 2 * 2 * 3
    points = {(task.case, task.value("traffic.sources"), task.value("nodes.count"), task.seed) for task in tasks}
    assert points == {
        (c, s, n, seed) for c in ("flooding", "gossip") for s in (1, 4) for n in (5, 9) for seed in (1, 2, 3)
    }
    assert {task.value("duration_s") for task in tasks} == {2.0}
    assert len({task.key for task in tasks}) == len(tasks)


def test_a_variant_may_be_like_another_one_but_not_like_itself() -> None:
    more = FILE + '\n[full]\nlike = "quick"\nseeds = 7\n'
    quick, full = (spec.parse(more, source="test").variant(name) for name in ("quick", "full"))
    assert list(full.settings()) == list(quick.settings())
    assert list(full.seed_list()) == [1, 2, 3, 4, 5, 6, 7]
    itself = FILE.replace("[quick]", '[quick]\nlike = "quick"')
    assert itself != FILE
    with pytest.raises(ConfigError, match=r'quick.like = "quick": a variant must be like another one'):
        spec.parse(itself, source="test").variant("quick")


def test_a_variant_replaces_what_it_names_and_nothing_else() -> None:
    tasks = tasks_of(spec.parse(FILE, source="test").variant("quick"))

    points = {(task.case, task.value("traffic.sources"), task.value("nodes.count"), task.seed) for task in tasks}
    assert points == {("gossip", 2, 5, 7), ("gossip", 2, 9, 7)}
    with pytest.raises(ConfigError, match="full: the sweep has quick"):
        spec.parse(FILE, source="test").variant("full")


def test_the_columns_of_a_table_are_the_keys_that_vary() -> None:
    varied = spec.parse(FILE, source="test").varied()
    assert varied == ["routing.protocol", "traffic.sources", "nodes.count", "routing.gossip_p"]


def test_an_axis_may_be_a_key_of_one_of_several_tables() -> None:
    text = 'base = "quick"\nset.traffic = [{name = "a"}, {name = "b"}]\ngrid."traffic.1.interval_s" = [2, 4]'
    tasks = tasks_of(spec.parse(text, source="test"))
    assert [task.value("traffic.1.interval_s") for task in tasks] == [2, 4]
    assert tasks[0].value("traffic.2.interval_s") is None


def test_the_command_of_a_run_names_every_change_and_the_seed() -> None:
    task = tasks_of(spec.parse(FILE, source="test"))[-1]
    assert task.command == (
        "fanet simulate flooding --set duration_s=2 --set 'routing.protocol=\"gossip\"' --set traffic.sources=4 "
        "--set nodes.count=9 --set routing.gossip_p=0.5 --seed 3"
    )


def test_a_run_in_real_time_is_another_run_with_the_command_that_launches_it() -> None:
    virtual, real = tasks_of(
        spec.parse('base = "quick"\ncase = [{name = "virtual"}, {name = "real", realtime = true}]', source="test")
    )
    assert virtual.tree == real.tree
    assert virtual.key != real.key
    assert (virtual.command, real.command) == ("fanet simulate quick --seed 1", "fanet launch quick --seed 1")
    with pytest.raises(ConfigError, match="lead_ms = 0 is for virtual time"):
        tasks_of(spec.parse('base = "flooding"\ncase = [{name = "real", realtime = true}]', source="test"))


def test_a_run_in_real_time_may_be_slowed_down_and_stays_the_same_run() -> None:
    text = 'base = "quick"\ncase = [{{name = "real", realtime = true{}}}]'
    (held,), (slowed,) = (
        tasks_of(spec.parse(text.format(more), source="test")) for more in ("", ", slow_down_to = 0.1")
    )
    assert held.key == slowed.key
    assert (held.slow_down_to, slowed.slow_down_to) == (None, 0.1)
    assert slowed.command == "fanet launch quick --seed 1 --slow-down-to 0.1"


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ("seeds = 3", "base: is missing"),
        ('base = "quick"\nseed = 1', "seed: unknown key; known keys: .*seeds"),
        (
            'base = "quick"\ncase = [{name = "a", seeds = 2}]',
            "case.0.seeds: unknown key; known keys: name, set, grid, r",
        ),
        ('base = "quick"\nquick = {seed = 1}', "quick.seed: unknown key; known keys: like, seeds, set, grid, cases$"),
        ('base = "quick"\nseeds = true', "seeds = True: .*integer"),
        ('base = "quick"\nseeds = ["1"]', r"seeds\.0 = '1': .*integer"),
        ('base = "quick"\ncase = [{name = "a", realtime = "no"}]', "case.0.realtime = 'no': .*boolean"),
        ('base = "quick"\nseeds = 0', r"seeds.* = 0: .*greater than or equal to 1"),
        ('base = "quick"\n[grid]\nnodes.count = []', r"grid.nodes.count = \[\]"),
        ('base = "quick"\n[[case]]\nset.nodes.count = 5', "case.0.name: is missing"),
        ('base = "quick"\n[[case]]\nname = "a"\nslow_down_to = 0.1', "case.0.*slow_down_to is for runs with realtime"),
        (
            'base = "quick"\ncase = [{name = "a"}, {name = "b"}, {name = "a", set.nodes.count = 5}]',
            "case.*two cases have the name 'a'",
        ),
        ("base = ", "not valid TOML"),
    ],
)
def test_a_mistake_in_the_file_is_named_with_its_key(text: str, mistake: str) -> None:
    with pytest.raises(ConfigError, match=f"test: {mistake}"):
        spec.parse(text, source="test")


def test_every_setting_that_cannot_run_is_named_before_the_first_run() -> None:
    found = spec.parse('base = "quick"\n[grid]\nnodes.count = [9, 0, 100000]', source="test")
    with pytest.raises(ConfigError) as error:
        tasks_of(found)
    assert "nodes.count=0" in str(error.value)
    assert "nodes.count=100000" in str(error.value)
    assert "nodes.count=9)" not in str(error.value)


@pytest.mark.parametrize("text", ["[set]\nseed = 5", "[grid]\nseed = [1, 2, 3]"])
def test_seeds_among_the_settings_are_refused_and_not_dropped(text: str) -> None:
    with pytest.raises(ConfigError, match="--seeds N"):
        tasks_of(spec.parse(f'base = "quick"\n{text}', source="test"))


def test_a_base_that_cannot_be_read_is_named_alone() -> None:
    with pytest.raises(ConfigError, match=r"^/dev/zero: cannot be read: a device, not a regular file$"):
        tasks_of(spec.parse('base = "/dev/zero"', source="test"))


def test_a_mistake_of_many_settings_is_said_once() -> None:
    found = spec.parse('base = "quick"\n[grid]\nduration_s = [20, 30]\nnodes.count = [0]', source="test")
    with pytest.raises(ConfigError) as error:
        tasks_of(found)
    assert str(error.value).count("greater than or equal to 1") == 1
    assert str(error.value).endswith("(duration_s=20, nodes.count=0; and in 1 other settings)")


def test_a_measure_that_there_is_not_is_an_error() -> None:
    with pytest.raises(ConfigError, match="measure = 'speed': must be one of delay_counts"):
        tasks_of(spec.parse('base = "quick"\nmeasure = ["speed"]', source="test"))


def test_flags_make_a_sweep_of_a_scenario() -> None:
    name, found = asked("quick", ("nodes.count=5,9", "duration_s=2", 'clusters.guard_ms=2,"auto"'), 4, None)
    assert name == "quick"
    assert found.set == {"duration_s": 2}
    assert found.grid == {"nodes.count": [5, 9], "clusters.guard_ms": [2, "auto"]}
    assert len(found.seed_list()) == 4


def test_flags_change_a_sweep_of_a_file(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    name, found = asked(str(path), ("traffic.sources=3", "nodes.count=6,7,8"), None, "quick")
    assert name == "mine"
    assert found.set["traffic.sources"] == 3
    assert found.grid == {"nodes.count": [6, 7, 8]}


def test_flags_replace_what_a_case_sets_too(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    _, one = asked(str(path), ("routing.protocol=counter", "routing.gossip_p=0.9"), None, None)
    assert {(s.changes["routing.protocol"], s.changes["routing.gossip_p"]) for s in one.settings()} == {
        ("counter", 0.9)
    }
    _, two = asked(str(path), ("routing.gossip_p=0.7,0.8",), None, None)
    found = {(setting.case, setting.changes["routing.gossip_p"]) for setting in two.settings()}
    assert found == {(case, share) for case in ("flooding", "gossip") for share in (0.7, 0.8)}


def test_a_flag_that_a_case_would_undo_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"--set traffic\.0\.interval_s: case \+ priorities sets traffic, .* part"):
        asked("ablation", ("traffic.0.interval_s=1",), None, None)


def test_what_is_no_sweep_has_no_variant_and_a_file_that_cannot_be_read_says_why(tmp_path) -> None:
    with pytest.raises(ConfigError, match="--variant quick: the sweep has no variants"):
        asked("flooding", (), None, "quick")
    path = tmp_path / "mine.toml"
    with pytest.raises(ConfigError, match=r"mine\.toml: cannot be read"):
        asked(str(path), (), None, "quick")
    path.write_text("base = ")
    with pytest.raises(ConfigError, match=r"mine\.toml: not valid TOML"):
        asked(str(path), (), None, "quick")


def test_commas_within_brackets_and_quotes_belong_to_a_value() -> None:
    assert axis('traffic.sources=[1,2],"all",3') == ("traffic.sources", [[1, 2], "all", 3])
    assert axis("routing.protocol=aodv,olsr") == ("routing.protocol", ["aodv", "olsr"])
    for wrong in ("nodes.count", "=3", "nodes.count="):
        with pytest.raises(ConfigError, match="must be KEY=VALUE"):
            axis(wrong)


values = st.recursive(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner, max_size=4),
    max_leaves=8,
)


@given(values)
def test_toml_text_of_a_value_is_read_back_as_that_value(value: object) -> None:
    assert one_value(toml_value(value)) == value


def test_every_shipped_sweep_is_valid_in_every_variant() -> None:
    for name in spec.shipped():
        found = spec.find(name)
        for variant in (None, *(known for known in spec.VARIANTS if getattr(found, known) is not None)):
            assert tasks_of(found.variant(variant).model_copy(update={"seeds": 1}))
