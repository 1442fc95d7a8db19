"""The application: its commands, and what becomes of errors."""

from __future__ import annotations

import contextlib
import sys

import typer
from rich.console import Console
from rich.text import Text

from replay.errors import ExitCode, ReplayError

app = typer.Typer(
    name="replay",
    help="Record, replay, look at and compare GNSS/INS navigation runs on one MCAP log.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


class _Terminal(Console):
    def on_broken_pipe(self) -> None:
        """End well where the reader left early: `replay info LOG | head -1` is no failure."""
        with contextlib.suppress(SystemExit):
            super().on_broken_pipe()
        sys.exit(int(ExitCode.OK))


out = _Terminal()
err = _Terminal(stderr=True)


def say(text: str) -> None:
    """Print a line that the terminal wraps, not this program: paths stay whole."""
    out.print(text, soft_wrap=True)


def warn(text: str) -> None:
    """Print such a line on the error stream."""
    err.print(text, soft_wrap=True)


def leave(code: ExitCode) -> None:
    """End the command with an exit code other than 0."""
    if code is not ExitCode.OK:
        raise typer.Exit(int(code))


def show_error(error: ReplayError) -> None:
    """Print an error for a person: what, where, how to mend it."""
    err.print(Text.assemble(("error: ", "bold red"), error.what))
    if error.where:
        err.print(Text.assemble(("where: ", "bold"), error.where))
    if error.mend:
        err.print(Text.assemble(("mend:  ", "bold"), error.mend))


def main() -> None:
    """Entry point of the console command."""
    # Commands register themselves on import; libraries are imported when a command runs.
    from replay.cli import baselines, logs, looks, runs  # noqa: F401

    try:
        app()
    except ReplayError as error:
        show_error(error)
        missing = isinstance(error.__cause__, FileNotFoundError)
        sys.exit(int(ExitCode.USAGE if missing else error.exit_code))
    except FileNotFoundError as error:
        show_error(ReplayError("no such file", where=str(error.filename)))
        sys.exit(int(ExitCode.USAGE))
    except BrokenPipeError:
        sys.exit(int(ExitCode.OK))
