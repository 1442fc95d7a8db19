"""Arguments that several commands take."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any

import typer

from replay.errors import UsageError

Output = Annotated[Path, typer.Option("-o", "--output", help="File to write.")]


def read_toml(path: Path) -> dict[str, Any]:
    """Table of a file that a command was given.

    Raises
    ------
    UsageError
        Where it is no TOML.
    """
    try:
        return tomllib.loads(path.read_text())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"not TOML: {error}", where=str(path)) from error
