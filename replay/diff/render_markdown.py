"""The result as a comment on a pull request: the verdict in sight, the tables folded away."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from replay.diff import words
from replay.diff.result import DiffResult, Verdict

_MARKS: Final = {
    Verdict.IDENTICAL: "🟰",
    Verdict.WITHIN_TOLERANCE: "✅",
    Verdict.CHANGED: "❌",
    Verdict.INCOMPARABLE: "⛔",
}


def render_markdown(result: DiffResult) -> str:
    """GitHub-flavoured Markdown.

    Parameters
    ----------
    result : DiffResult

    Returns
    -------
    str
        Ends in a newline.
    """
    lines = words.headlines(result)
    parts = [f"### {_MARKS[result.verdict]} {result.verdict.value}", "; ".join(result.reasons)]
    parts += [f"- {_escape(line)}" for line in lines[1:]]
    parts.append(f"A `{result.a.path}`, B `{result.b.path}`")
    channels = [words.channel_row(channel) for channel in result.channels]
    parts.append(_folded("Channels", _table(words.CHANNEL_HEADER, channels)))
    fields = [row for channel in words.differing(result) for row in words.field_rows(channel)]
    if fields:
        parts.append(_folded("Fields that differ", _table(words.FIELD_HEADER, fields)))
    divergence = result.first_change or result.first_difference
    if divergence is not None and divergence.around:
        rows = [
            (
                "▶" if row.here else "",
                words.clock(row.at),
                row.kind.value,
                row.a,
                row.b,
                "" if row.difference is None else words.number(row.difference, divergence.unit),
            )
            for row in divergence.around
        ]
        field = words.component(divergence.field, divergence.component)
        title = f"Rows around the first: {divergence.topic} {field}".rstrip()
        parts.append(_folded(title, _table(("", "row", "kind", "A", "B", "A-B"), rows)))
    for title, settings in (
        ("Configuration that differs", result.configuration),
        ("Versions that differ", result.versions),
        ("Input channels that differ", result.inputs),
    ):
        if settings:
            rows_ = [(s.key, s.a or "", s.b or "") for s in settings]
            parts.append(_folded(title, _table(("key", "A", "B"), rows_)))
    return "\n\n".join(_join_bullets(parts)) + "\n"


def _join_bullets(parts: Iterable[str]) -> list[str]:
    """Paragraphs, with neighbouring bullets in one."""
    joined: list[str] = []
    for part in parts:
        if part.startswith("- ") and joined and joined[-1].startswith("- "):
            joined[-1] += f"\n{part}"
        else:
            joined.append(part)
    return joined


def _escape(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(_escape(cell) for cell in line) + " |" for line in lines)


def _folded(title: str, body: str) -> str:
    return f"<details><summary>{title}</summary>\n\n{body}\n\n</details>"
