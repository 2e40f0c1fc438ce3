"""Wireshark's dissector: it is what pymavlink makes of our XML, and the command installs it."""

import importlib.util
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from emulator.pcap import PORT
from fanet_mw import wire
from sim.cli.app import app

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def generate() -> Callable[..., int]:
    spec = importlib.util.spec_from_file_location("generator", ROOT / "scripts" / "generate_dissector.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    main: Callable[..., int] = module.main
    return main


def test_the_dissector_checked_in_is_what_the_xml_gives(generate: Callable[..., int]) -> None:
    assert generate(["--check"]) == 0


@pytest.mark.slow
def test_a_changed_xml_fails_the_check_until_it_is_generated_again(
    generate: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    xml, target = tmp_path / "fanet.xml", tmp_path / "mavlink.lua.gz"
    text = (ROOT / "fanet_mw" / "dialect" / "fanet.xml").read_text(encoding="utf-8")
    shutil.copy(ROOT / "emulator" / "wireshark" / "mavlink.lua.gz", target)
    xml.write_text(text.replace('name="reporter"', 'name="witness"'), encoding="utf-8")
    assert generate(["--check"], xml=xml, target=target) == 1
    assert "run scripts/generate_dissector.py" in capsys.readouterr().err
    assert generate([], xml=xml, target=target) == 0
    assert generate(["--check"], xml=xml, target=target) == 0
    assert generate(["--chekc"], xml=xml, target=target) == 2


def test_the_command_installs_a_dissector_that_knows_our_messages_and_our_port(tmp_path: Path) -> None:
    assert app(["dissector", str(tmp_path / "plugins")], result_action="return_value") == 0
    text = (tmp_path / "plugins" / "mavlink.lua").read_text(encoding="utf-8")
    assert f"udp_dissector_table:add({PORT}, mavlink_proto)" in text
    assert all(f"[{spec.msgid}] = 'FANET_" in text for spec in wire.SPECS)
    assert "[0] = 'HEARTBEAT'" in text
