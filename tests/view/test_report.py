"""The page: alone, whole, and the same bytes each time."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import fake_run
import pytest

from replay.log.columns import Columns
from replay.view.report import report_html

_STATISTICS = {"mean": 0.01, "std": 0.12, "rms": 0.123, "p95": 0.3, "max": 0.75}
EVALUATION = {
    "position_error_m": {
        axis: _STATISTICS for axis in ("east", "north", "up", "horizontal", "3d")
    },
    "velocity_error_m_s": {"east": _STATISTICS},
    "attitude_error_deg": {"roll": _STATISTICS, "heading": {"rms": float("nan")}},
    "outages": [{"start_s": 100.0, "end_s": 130.0, "duration_s": 30.0, "horizontal_drift_m": 3.1}],
    "nees": {"position": {"mean": 2.9, "expected": 3}},
    "note": None,
}  # fmt: skip


class _Loads(HTMLParser):
    """Collects what a page would load, and counts elements."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.tags: dict[str, int] = {}
        self.labels: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] = self.tags.get(tag, 0) + 1
        for name, value in attrs:
            if name in ("src", "href", "xlink:href", "data", "srcset") and value:
                self.loads.append(value)
            if name == "aria-label" and value:
                self.labels.append(value)


@pytest.fixture(scope="module")
def page(channels: dict[str, Columns], metadata: dict[str, dict[str, str]]) -> str:
    return report_html(
        fake_run.in_batches(channels), metadata, evaluation=EVALUATION, title="A <drive>"
    )


def test_nothing_is_loaded(page: str) -> None:
    parser = _Loads()
    parser.feed(page)
    assert all(load.startswith("#") for load in parser.loads)
    assert "script" not in parser.tags and "link" not in parser.tags and "img" not in parser.tags
    assert "@import" not in page and "url(http" not in page
    assert len(page) < 3_000_000


def test_references_inside_the_figures_are_whole(page: str) -> None:
    ids = set(re.findall(r' id="([^"]+)"', page))
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', page))
    assert used <= ids


def test_every_figure_is_there_and_is_told_in_words(page: str) -> None:
    parser = _Loads()
    parser.feed(page)
    assert parser.tags["figure"] == parser.tags["svg"] == len(parser.labels)
    told = " ".join(parser.labels)
    for words in (
        "Plan of the trajectory", "Position error east", "Velocity error north",
        "Attitude error heading", "Gyro bias x forward", "Accel. scale factor z down",
        "Position east innovation", "Histograms", "NIS per degree of freedom", "Satellites used",
        "Angular rate x forward",
    ):  # fmt: skip
        assert words in told, words


def test_figures_and_facts(page: str) -> None:
    for text in (
        "A &lt;drive&gt;", "0.123", "Worst horizontal drift", "3.10", "NEES position mean",
        "pipeline loose", "gate_sigma = 3.5", "0f" * 32, "/solution/tight", "cut on purpose",
        "outage begin: no position for 2.0 s",
    ):  # fmt: skip
        assert text in page, text
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL).lower()


def test_same_log_same_bytes_however_it_is_cut(
    page: str, channels: dict[str, Columns], metadata: dict[str, dict[str, str]]
) -> None:
    again = report_html(
        fake_run.in_batches(channels, 7.3), metadata, evaluation=EVALUATION, title="A <drive>"
    )
    assert page == again


@pytest.mark.parametrize(
    "kept",
    [(), ("/truth",), ("/imu/raw",), ("/gnss/rover/fix",), ("/solution/tight", "/truth"),
     ("/filter/tight/innovations",), ("/filter/tight/state",), ("/filter/tight/events",)],
)  # fmt: skip
def test_little_of_a_log_gives_a_short_page(
    kept: tuple[str, ...], channels: dict[str, Columns]
) -> None:
    few = {topic: channels[topic] for topic in kept}
    page = report_html(fake_run.in_batches(few) if few else [], {}, title="little")
    assert "The log has no manifest." in page


def test_an_evaluation_per_run(metadata: dict[str, dict[str, str]]) -> None:
    names = ("loose", "tight")
    made = fake_run.make_channels(30.0, imu_hz=20, runs=names)
    runs = {topic: made[topic] for topic in made if topic.startswith("/solution/")}
    page = report_html(
        fake_run.in_batches(runs), metadata, evaluation=dict.fromkeys(names, EVALUATION), title="x"
    )
    assert "<h3>loose</h3>" in page and "<h3>tight</h3>" in page
