"""Where the command begins, and what becomes of errors."""

from __future__ import annotations

import sys

# Commands register themselves on import; what they need is imported when one runs.
from replay.cli import baselines, logs, looks, runs, studies, sweeps, transforms  # noqa: F401
from replay.cli.app import app, show_error
from replay.errors import ExitCode, ReplayError


def main() -> None:
    """Entry point of the console command."""
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
