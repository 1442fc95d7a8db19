"""The application that commands register with, and how it speaks."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import Final, TextIO

import typer
from rich.console import Console
from rich.text import Text

from replay.errors import ExitCode, ReplayError

_WIDTH_OF_A_FILE: Final = 160

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


def _width(stream: TextIO) -> int | None:
    """Width of a stream: a terminal's own, or room for every table where there is none."""
    known = stream.isatty() or "COLUMNS" in os.environ
    return None if known else _WIDTH_OF_A_FILE


out = _Terminal(width=_width(sys.stdout))
err = _Terminal(stderr=True, width=_width(sys.stderr))


def say(text: str, *, lead: str = "", style: str = "") -> None:
    """Print a line that the terminal wraps, not this program: paths stay whole.

    Parameters
    ----------
    text : str
        Printed as it stands, brackets and all.
    lead : str
        Printed before it, in `style`.
    style : str
        A style of rich, such as "bold red".
    """
    out.print(Text.assemble((lead, style), text), soft_wrap=True)


def warn(text: str, *, lead: str = "", style: str = "") -> None:
    """Print such a line on the error stream."""
    err.print(Text.assemble((lead, style), text), soft_wrap=True)


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
