"""Pages written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from replay.errors import ReplayError


def write_page(out_html: Path, text: str) -> None:
    """Write a page; the file takes its name only when it is whole.

    Raises
    ------
    ReplayError
        Where it cannot be written.
    """
    part = out_html.with_name(out_html.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, out_html)
    except OSError as error:
        raise ReplayError(
            f"the report cannot be written: {error.strerror or error}",
            where=str(out_html),
            mend="choose a folder that exists and has room",
        ) from error
