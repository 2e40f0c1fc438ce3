"""The `fanet` command: which commands there are, and what becomes of errors and signals.

Commands stand in the modules beside this one by subject. They are all registered before one of them is known to be
wanted, so a module of commands imports at its top only what `--help` needs.
"""

import sys

from cyclopts import App

from fanet_mw import __version__
from fanet_mw.errors import FanetError
from fanet_mw.hosts import interrupts
from sim.cli import figures, runs, scenario_files, single_services, swarms, sweep, tool_files
from sim.cli.air import app as air_app
from sim.cli.console import Console, nobody_reads

app = App(
    name="fanet",
    help="Middleware for swarms of UAVs, and the network emulator it is developed and proven on.",
    version=__version__,
    version_format="plaintext",  # as Markdown it would be rendered by a parser that takes long to import
    console=Console(),
    suppress_keyboard_interrupt=False,
)
app.command(air_app)
for commands in (scenario_files, sweep, figures, runs, single_services, swarms, tool_files):
    commands.add_to(app)
app.register_install_completion_command()


def main() -> None:
    """The console script."""
    interrupts.install()
    try:
        code = app(result_action="return_value")
        sys.stdout.flush()
    except BrokenPipeError:
        nobody_reads()
    except FanetError as error:
        Console(stderr=True).print(f"[bold red]fanet:[/] {error}", highlight=False, soft_wrap=True)
        code = 2
    except ModuleNotFoundError as error:
        from rich.markup import escape

        from fanet_mw.installation import missing_extra

        if (why := missing_extra(error)) is None:
            raise
        Console(stderr=True).print(f"[bold red]fanet:[/] {escape(why)}", highlight=False, soft_wrap=True)
        code = 2
    except KeyboardInterrupt as interrupt:
        code = interrupts.exit_code(interrupt)
    interrupts.leave(code if isinstance(code, int) else 0)


if __name__ == "__main__":
    main()
