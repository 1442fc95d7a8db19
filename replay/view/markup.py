"""Small pieces of HTML, every text escaped."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from html import escape

from replay.view.charts import Chart


@dataclasses.dataclass(frozen=True, slots=True)
class Table:
    """A table of texts.

    Attributes
    ----------
    head : tuple of str
    rows : tuple of tuple of str
    caption : str
    text_columns : int
        How many leading columns are words; the rest are numbers.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    text_columns: int = 1

    def html(self) -> str:
        """A `<table>` element."""
        return (
            "<div class='table'><table>"
            + (f"<caption>{escape(self.caption)}</caption>" if self.caption else "")
            + "<thead>"
            + self._row(self.head, "th")
            + "</thead><tbody>"
            + "\n".join(self._row(row, "td") for row in self.rows)
            + "</tbody></table></div>"
        )

    def _row(self, cells: Sequence[str], tag: str) -> str:
        return (
            "<tr>"
            + "".join(
                f"<{tag}{'' if i < self.text_columns else ' class=n'}>{escape(cell)}</{tag}>"
                for i, cell in enumerate(cells)
            )
            + "</tr>"
        )


def figure(chart: Chart, alternative: str) -> str:
    """A `<figure>` with a text for those who do not see it."""
    svg = chart.svg.replace("<svg", f"<svg role='img' aria-label='{escape(alternative)}'", 1)
    return f"<figure>{svg}<figcaption>{escape(chart.caption)}</figcaption></figure>"


def section(title: str, parts: Iterable[str]) -> str:
    """A section with a heading; nothing where it has no part."""
    body = "\n".join(part for part in parts if part)
    anchor = "".join(c if c.isalnum() else "-" for c in title.lower())
    return f"<section id='{anchor}'><h2>{escape(title)}</h2>\n{body}</section>" if body else ""


def tiles(items: Iterable[tuple[str, str, str]]) -> str:
    """The few figures that matter most: label, value, unit."""
    cells = "".join(
        f"<div><dt>{escape(label)}</dt><dd>{escape(value)} <small>{escape(unit)}</small></dd></div>"
        for label, value, unit in items
    )
    return f"<dl class='tiles'>{cells}</dl>" if cells else ""


STYLE = """
:root { color-scheme: light; --ink: #1c2027; --soft: #5b616b; --line: #dfe2e7; --tint: #f5f6f8; }
* { box-sizing: border-box; }
body { margin: 0; background: #fff; color: var(--ink); font: 15px/1.5 system-ui, -apple-system,
  "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 40px 32px 64px; }
h1 { font-size: 28px; line-height: 1.2; margin: 0 0 6px; letter-spacing: -.01em; }
h2 { font-size: 19px; margin: 44px 0 12px; padding-top: 12px; border-top: 1px solid var(--line); }
h3 { font-size: 15px; margin: 24px 0 6px; }
p, figcaption, caption { color: var(--soft); }
p.sub { margin: 0 0 20px; }
figcaption, caption { font-size: 13px; text-align: left; }
caption { padding: 0 0 6px; }
figure { margin: 14px 0 26px; break-inside: avoid; }
figure svg { display: block; width: 100%; height: auto; }
.table { overflow-x: auto; margin: 12px 0 22px; break-inside: avoid; }
table { border-collapse: collapse; font-size: 13.5px; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 5px 18px 5px 0; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { font-weight: 600; border-bottom-color: #b9bec7; vertical-align: bottom; }
th.n, td.n { text-align: right; }
td.n { white-space: nowrap; }
td { overflow-wrap: anywhere; }
.dense table { font-size: 12.5px; }
.dense th, .dense td { padding-right: 11px; }
.dense td:first-child { white-space: nowrap; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 12px;
  margin: 18px 0; }
.tiles div { background: var(--tint); border-radius: 8px; padding: 12px 14px; break-inside: avoid; }
.tiles dt { font-size: 12.5px; color: var(--soft); }
.tiles dd { margin: 2px 0 0; font-size: 22px; font-weight: 600;
  font-variant-numeric: tabular-nums; }
.tiles small { font-size: 13px; font-weight: 400; color: var(--soft); }
pre { background: var(--tint); border-radius: 8px; padding: 12px 14px; font: 12.5px/1.45
  ui-monospace, "SF Mono", Menlo, Consolas, "DejaVu Sans Mono", monospace; overflow-x: auto;
  white-space: pre-wrap; }
code { font: 12.5px ui-monospace, Menlo, Consolas, "DejaVu Sans Mono", monospace; }
@media print { main { max-width: none; padding: 0; } body { font-size: 11pt; }
  h2 { break-after: avoid; } section { break-inside: auto; } }
"""


def page(title: str, body: str) -> str:
    """A whole document that loads nothing."""
    return (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n"
        f"<body><main>\n{body}\n</main></body></html>\n"
    )
