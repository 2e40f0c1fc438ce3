"""What the flags of `fanet sweep` mean, typed as a user types them."""

import pytest

from sim.cli.app import app, changes_last


@pytest.mark.parametrize(
    "line",
    [
        "sweep quick --set nodes.count=5,6,7 --set traffic.interval_s=1,2 --seeds 4",
        "sweep quick --set nodes.count=5,6,7 traffic.interval_s=1,2 --seeds 4",
        "sweep --set nodes.count=5,6,7 --seeds 4 --set traffic.interval_s=1,2 quick",
    ],
)
def test_keys_are_set_one_by_one_or_together_before_or_behind_the_name(
    line: str, tmp_path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*line.split(), "--dry-run", "--jobs", "1", "--out", str(tmp_path)]
    assert app(changes_last(words), result_action="return_value") == 0
    assert "24 runs (6 settings x 4 seeds)" in capsys.readouterr().err
