"""How many examples a property is tried with is what the profile of the run says."""

import re
from pathlib import Path

import pytest
from hypothesis import settings
from kit import examples

TESTS = Path(__file__).parents[2]


def test_no_module_reads_conftest_a_second_time_and_with_it_the_default_profile() -> None:
    imports = re.compile(r"^(from (tests\.)?conftest import|import (tests\.)?conftest)", re.MULTILINE)
    again = [path.name for path in sorted(TESTS.rglob("*.py")) if imports.search(path.read_text(encoding="utf-8"))]
    assert again == []


@pytest.mark.parametrize(("profile", "count"), [("default", 6), ("explore", 60), ("mutants", 6)])
def test_a_property_with_a_number_of_its_own_is_tried_oftener_in_a_long_run(profile: str, count: int) -> None:
    chosen = settings.get_current_profile_name()
    settings.load_profile(profile)
    try:
        assert examples(6).max_examples == count
    finally:
        settings.load_profile(chosen)
