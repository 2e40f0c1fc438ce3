"""The `fanet` command: registers all commands, and turns errors and signals into messages and exit codes.

The commands are in the modules beside this one, by subject. All of them are registered whichever command is called, so
these modules import at their top only what `--help` needs.
"""

import errno
import re
import sys
from collections.abc import Callable, Sequence
from typing import Final

from cyclopts import App, CycloptsError, UnusedCliTokensError, _convert

from fanet_mw import __version__
from fanet_mw.errors import ConfigError, FanetError
from fanet_mw.hosts import interrupts
from sim.cli import (
    air,
    figures,
    inspect,
    log,
    order,
    replay,
    runs,
    scenario_files,
    single_services,
    swarms,
    sweep,
    tool_files,
)
from sim.cli.memory import require_for
from sim.cli.options import OPTIONS, RUN, RUNNING, SCENARIO, SERVICE, STUDY, TOOLS
from sim.console import Console, discard_output, escape_what_has_no_code, nobody_reads, open_closed_streams, printable

app = App(
    name="fanet",
    help="Middleware for swarms of UAVs, and the network emulator it is developed and proven on.",
    version=__version__,
    version_format="plaintext",  # Markdown would be rendered by a parser that takes long to import
    console=Console(wraps=True),
    suppress_keyboard_interrupt=False,
)
for group_of_commands in (air.app, order.app, log.app, inspect.topic):
    app.command(group_of_commands)
for group, commands in (
    (SCENARIO, (scenario_files.scenarios, scenario_files.init, scenario_files.show, scenario_files.check)),
    (SCENARIO, (scenario_files.schema,)),
    (STUDY, (sweep.sweep, figures.figures, figures.report)),
    (RUN, (runs.simulate, runs.launch, runs.plan, replay.replay)),
    (SERVICE, (single_services.router, single_services.emulator, single_services.world, single_services.agent)),
    (SERVICE, (single_services.autopilots,)),
    (RUNNING, (log.record, swarms.links, swarms.swarms, swarms.gateway, swarms.view, swarms.top, inspect.inspect)),
    (TOOLS, (tool_files.keys, tool_files.dialect, tool_files.dissector)),
):
    for command in commands:
        app.command(command, group=group)
app.register_install_completion_command()
_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_MOST_LINES: Final = 20
_LONGEST_LINE: Final = 900


def _whole(text: str) -> int:
    """A whole number as cyclopts reads it, except that it would round: `air cut 2.5` would cut node 2 off."""
    number = _cyclopts_int(text)
    if "." in text and float(text) != number:
        raise ValueError(text)
    return number


_cyclopts_int: Final[Callable[[str], int]] = _convert._converters[int]  # noqa: SLF001  (there is no public way)
_convert._converters[int] = _whole  # noqa: SLF001
for option in ("--help", "--version", "--install-completion"):
    app[option].group = (OPTIONS,)


def changes_last(words: Sequence[str]) -> list[str]:
    """The words of a command line with `--set` last. It takes the next word, and all further ones that contain `=`."""
    changes: list[str] = []
    rest: list[str] = []
    taking, first = False, False
    for word in words:
        if word == "--set":
            taking = first = True
        elif taking and not word.startswith("-") and (first or "=" in word):
            changes.append(word)
            first = False
        else:
            taking = False
            rest.append(word)
    return [*rest, "--set", *changes] if changes and "--" not in words else list(words)


def require_values(words: Sequence[str]) -> None:
    """Raise ConfigError for an option whose value is empty, as that of a variable of the shell which is not set."""
    for option, value in zip(words, [*words[1:], "-"], strict=True):
        if option.startswith("--") and (not value or re.fullmatch("--[a-z-]+=", option)):
            raise ConfigError(f"{option.rstrip('=')}: its value is empty")


def refused(why: str) -> int:
    """Print why a request could not be met, in few short lines; returns the exit code for that."""
    from rich.text import Text

    lines = [_printable(line) for line in why.split("\n")]
    if len(lines) > _MOST_LINES:
        lines = [*lines[: _MOST_LINES - 1], f"and {len(lines) - _MOST_LINES + 1} more mistakes"]
    text = Text.assemble(("fanet:", "bold red"), " ", "\n".join(lines))
    Console(stderr=True).print(text, highlight=False, soft_wrap=True)
    return 2


def _printable(line: str) -> str:
    """A line that may hold what somebody else wrote: what would move the cursor is escaped, and the middle left out."""
    shown = printable(line.replace("\t", "\\t"))
    return shown if len(shown) <= _LONGEST_LINE else f"{shown[: _LONGEST_LINE - 200]} ... {shown[-190:]}"


def misread(error: CycloptsError) -> str:
    """What cyclopts did not understand, in one line. A change of the scenario that stands alone lacks its `--set`."""
    if isinstance(error, UnusedCliTokensError) and error.unused_tokens:
        changes = " ".join(word for word in error.unused_tokens if re.match(r"[a-z_]+(\.\w+)*=", word))
        unused = " ".join(error.unused_tokens)
        return f"not understood: {unused}{f'; a key of the scenario is changed by --set {changes}' if changes else ''}"
    return " ".join(str(error).split())


def _interrupted(interrupt: KeyboardInterrupt) -> int:
    if not interrupts.is_signal(interrupt):
        return refused("a part of another package has raised KeyboardInterrupt")
    if (why := interrupts.sentence(interrupt)) is not None:
        sys.stderr.write(f"fanet: {why}\n")
    return interrupts.exit_code(interrupt)


def main() -> None:
    interrupts.install()
    open_closed_streams()
    escape_what_has_no_code()
    if sys.flags.optimize >= 2 and (not sys.argv[1:] or "--help" in sys.argv or "-h" in sys.argv):
        sys.stderr.write("fanet: python -OO has removed what the commands and options mean; without -OO it is shown\n")
    try:
        require_for(sys.argv[1:])
        require_values(sys.argv[1:])
        with interrupts.undisguised():
            words = changes_last(sys.argv[1:])
            code = app(words, result_action="return_value", exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except BrokenPipeError:
        nobody_reads()
    except (FanetError, CycloptsError) as error:
        code = refused(misread(error) if isinstance(error, CycloptsError) else str(error))
    except OSError as error:
        if error.errno not in _NO_ROOM:
            raise
        code = refused(f"{error.filename or 'standard output'}: cannot be written: {error.strerror}")
        if error.filename is None:
            discard_output()
    except MemoryError:
        code = refused("not enough memory, or the limit of this shell is too low (ulimit -v)")
    except ModuleNotFoundError as error:
        from fanet_mw.installation import missing_extra

        if (why := missing_extra(error)) is None:
            raise
        code = refused(why)
    except KeyboardInterrupt as interrupt:
        code = _interrupted(interrupt)
    interrupts.leave(code if isinstance(code, int) else 0)


if __name__ == "__main__":
    main()
