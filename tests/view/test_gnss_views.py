"""Runs over observations: what their recordings and pages hold."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import fake_gnss
import fake_run
import numpy as np
import pytest
from view_recordings import Entity, read_back, unix_like

from replay.log.columns import Columns
from replay.view.charts import Clock
from replay.view.gather import gather
from replay.view.geometry_panels import dop_limits
from replay.view.palette import TRUTH
from replay.view.panels import Curve, broken, robust_limits
from replay.view.recording import record
from replay.view.report import report_html
from replay.view.sky_chart import sky_chart, tracking_chart

NS = 1_000_000_000


@pytest.fixture(scope="module")
def gnss() -> dict[str, Columns]:
    return fake_gnss.make_gnss()


@pytest.fixture(scope="module")
def gnss_entities(
    gnss: dict[str, Columns], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Entity]:
    out = tmp_path_factory.mktemp("gnss") / "run.rrd"
    record(fake_run.in_batches(gnss), {}, out, name="rtk")
    return read_back(out)


@pytest.fixture(scope="module")
def page(gnss: dict[str, Columns]) -> str:
    return report_html(fake_run.in_batches(gnss), {}, title="rtk")


def test_entities_of_a_run_without_attitude(gnss_entities: dict[str, Entity]) -> None:
    expected = {
        "/map/run/rtk/path", "/world/run/rtk/place", "/state/run/rtk", "/events/gnss/rover",
        "/plots/geometry/rtk/satellites/all", "/plots/geometry/rtk/satellites/gps",
        "/plots/geometry/rtk/pdop/gps", "/plots/geometry/rtk/dop/hdop",
        "/plots/clock/rtk/offset/offset", "/plots/clock/rtk/between/C",
        "/plots/displacement/rover/length/rover",
        "/plots/ambiguities/rtk/ratio/fixed", r"/plots/ambiguities/rtk/away/G08_1C",
        "/plots/residuals/rtk/carrier_phase/G08", "/plots/slips/rover/loss_of_lock",
        "/plots/corrections/rover/ionosphere/E03",
        "/plots/position_change_error/up/rtk", "/plots/position_error/east/rtk/error",
    }  # fmt: skip
    assert expected <= set(gnss_entities)
    strange = ("/plots/velocity", "/plots/attitude", "/place/body")
    assert not [p for p in gnss_entities if any(word in p for word in strange)]
    assert not any("shapiro" in p for p in gnss_entities)  # absent
    assert not any("group_delay" in p for p in gnss_entities)  # nought
    states = gnss_entities["/state/run/rtk"].columns["StateChange:state"].to_pylist()
    assert {state for (state,) in states} == {"single", "float", "fixed"}


def test_values_are_those_of_the_channels(
    gnss_entities: dict[str, Entity], gnss: dict[str, Columns]
) -> None:
    total = gnss_entities["/plots/geometry/rtk/satellites/all"].values("Scalars:scalars")
    assert np.nanmin(total) == 6.0 and np.nanmax(total) == 10.0
    between = gnss_entities["/plots/clock/rtk/between/C"].values("Scalars:scalars")
    np.testing.assert_allclose(between[np.isfinite(between)], -5.0, atol=1e-6)
    used = gnss_entities["/plots/residuals/rtk/carrier_phase/G08"]
    innovations = gnss["/filter/rtk/innovations"]
    names = np.array(innovations.ragged("satellite").texts())
    rows = (names == "G08") & (innovations["kind"] == 8) & innovations["accepted"]
    np.testing.assert_array_equal(used.times_ns, unix_like(innovations.valid_time_ns[rows]))
    np.testing.assert_array_equal(used.values("Scalars:scalars"), innovations["innovation"][rows])
    slips = gnss_entities["/plots/slips/rover/geometry_free"].values("Scalars:scalars")
    np.testing.assert_array_equal(slips, [1.0, 1.0])


def test_lines_do_not_run_across_a_gap(gnss_entities: dict[str, Entity]) -> None:
    for path in ("/plots/position_error/east/rtk/error", "/plots/geometry/rtk/satellites/all"):
        values = gnss_entities[path].values("Scalars:scalars")
        assert np.count_nonzero(np.isnan(values)) == 1, path


def test_the_page_tells_of_satellites(page: str) -> None:
    labels = " ".join(re.findall(r"aria-label='([^']+)'", page))
    for words in (
        "Satellites used", "PDOP", "Sky plot of rover", "Satellites of rover along time",
        "Offset from GPS time [ms]", "Others less GPS", "Ratio of second to best",
        "Carrier phase innovations, accepted", "Troposphere, hydrostatic [m]", "Cycle slips",
        "Position change error north", "Satellite clock [km]",
    ):  # fmt: skip
        assert words in labels, words
    assert "Attitude error" not in labels
    for name in fake_gnss.SATELLITES:
        assert f"{name}</text>" in page
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL).lower()
    assert len(page) < 1_500_000


def test_same_bytes_however_the_log_is_cut(page: str, gnss: dict[str, Columns]) -> None:
    assert page == report_html(fake_run.in_batches(gnss, 7.3), {}, title="rtk")


@pytest.mark.parametrize(
    "missing",
    ["/truth", "/solution/rtk", "/filter/rtk/geometry", "/filter/rtk/clocks",
     "/filter/rtk/resolution", "/filter/rtk/ambiguities", "/filter/rtk/innovations",
     "/gnss/rover/satellites", "/gnss/rover/slips", "/gnss/rover/corrections",
     "/gnss/rover/displacement", "/gnss/rover/obs"],
)  # fmt: skip
def test_what_is_missing_is_left_out(
    missing: str, gnss: dict[str, Columns], tmp_path: Path
) -> None:
    rest = {t: c.take(slice(0, 400)) for t, c in gnss.items() if t != missing}
    record(fake_run.in_batches(rest), {}, tmp_path / "less.rrd", name="less")
    assert read_back(tmp_path / "less.rrd")["/about"].static


@pytest.mark.parametrize(
    "kept",
    [("/solution/rtk",), ("/filter/rtk/geometry", "/filter/rtk/clocks"), ("/gnss/rover/slips",),
     ("/gnss/rover/satellites",), ("/filter/rtk/resolution",)],
)  # fmt: skip
def test_little_of_a_log_gives_a_short_page(
    kept: tuple[str, ...], gnss: dict[str, Columns]
) -> None:
    few = {topic: gnss[topic] for topic in kept}
    assert "<h1>little</h1>" in report_html(fake_run.in_batches(few), {}, title="little")


def test_the_axis_is_that_of_the_run_not_of_a_base_that_began_before(
    gnss: dict[str, Columns],
) -> None:
    early = gnss["/gnss/rover/obs"]
    hour = 3600 * NS
    base = dataclasses.replace(
        early, valid_time_ns=early.valid_time_ns - hour, log_time_ns=early.log_time_ns - hour
    )
    data = gather([{**gnss, "/gnss/base/obs": base}], {})
    solution = gnss["/solution/rtk"].valid_time_ns
    assert data.span_ns == (int(solution[0]), int(solution[-1]))
    assert [(o.end_ns - o.start_ns) // NS for o in data.outages] == [13]


def test_the_sky_has_north_up_and_the_zenith_in_the_middle() -> None:
    """One satellite in the east at 30 deg: right of the middle by two thirds of the radius."""
    n = 5
    sight = fake_gnss.make_gnss(5.0)["/gnss/rover/satellites"].take(slice(0, n))
    values = dict(sight.values)
    values["satellite"] = values["satellite"].from_texts(["G01"] * n)
    values["azimuth_rad"] = np.full(n, np.pi / 2)
    values["elevation_rad"] = np.full(n, np.radians(30.0))
    chart = sky_chart("rover", Columns.build(sight.valid_time_ns + np.arange(n) * NS, values))
    assert chart is not None
    dots = re.findall(r'<use [^>]*?x="([\d.]+)" y="([\d.]+)"', chart.svg)
    (dot,) = {tuple(map(float, d)) for d in dots}
    places = _letters(chart.svg)
    centre = ((places["E"][0] + places["W"][0]) / 2, (places["N"][1] + places["S"][1]) / 2)
    edge = places["E"][0] - centre[0]  # names of the sides stand a little outside
    assert 0.55 < (dot[0] - centre[0]) / edge < 2.0 / 3.0
    assert dot[1] == pytest.approx(centre[1], abs=0.05 * edge)
    assert places["N"][1] < centre[1] < places["S"][1]
    values["elevation_rad"] = np.full(n, np.radians(-3.0))
    assert sky_chart("rover", Columns.build(sight.valid_time_ns, values)) is None


def _letters(svg: str) -> dict[str, tuple[float, float]]:
    found = re.findall(r"<text([^>]*)>([NESW])</text>", svg)
    places: dict[str, tuple[float, float]] = {}
    for attributes, letter in found:
        numbers = re.search(r'x="([\d.]+)" y="([\d.]+)"', attributes)
        if numbers is None:
            numbers = re.search(r"translate\(([\d.]+) ([\d.]+)\)", attributes)
        assert numbers is not None
        places[letter] = (float(numbers[1]), float(numbers[2]))
    return places


def test_tracking_has_a_row_for_a_satellite_that_only_slipped(gnss: dict[str, Columns]) -> None:
    slips = gnss["/gnss/rover/slips"]
    satellites = gnss["/gnss/rover/satellites"]
    names = np.array(satellites.ragged("satellite").texts())
    without = satellites.take(names != "C20")
    clock = Clock(int(satellites.valid_time_ns[0]), int(satellites.valid_time_ns[-1]))
    chart = tracking_chart("rover", without, slips, clock)
    assert chart is not None and "C20</text>" in chart.svg
    assert "slip, repaired" in chart.svg


def test_broken_lines() -> None:
    times = np.array([0, 1, 2, 3, 20, 21]) * NS
    line = broken(Curve("a", "a", times, np.arange(6.0), TRUTH))
    np.testing.assert_array_equal(np.isnan(line.values), [0, 0, 0, 0, 1, 0, 0])
    assert line.times_ns[4] == 11 * NS + NS // 2
    whole = Curve("a", "a", times[:4], np.arange(4.0), TRUTH)
    assert broken(whole) is whole
    one = Curve("a", "a", times[:1], np.arange(1.0), TRUTH)
    assert broken(one) is one


def test_limits_cut_what_is_far_out_and_only_that() -> None:
    even = np.linspace(-1.0, 1.0, 1001)
    assert robust_limits([even]) is None
    low, high = robust_limits([np.append(even, 500.0)])
    assert -2.0 < low < -1.0 and 1.0 < high < 2.0
    # The method that errs most sets the limits.
    low, high = robust_limits([np.append(even, 500.0), 10.0 * even])
    assert 10.0 < high < 20.0 and -20.0 < low < -10.0
    assert robust_limits([]) is None and robust_limits([np.full(3, np.nan)]) is None
    assert dop_limits([np.append(np.full(500, 2.0), 1e5)])[1] <= 20.0
    assert dop_limits([np.full(3, np.nan)]) is None
