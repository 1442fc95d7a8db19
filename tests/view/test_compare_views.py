"""Comparisons on a page and in a recording, and the scenes they choose."""

from __future__ import annotations

import re
from pathlib import Path

import fake_gnss
import numpy as np
import pytest
from fake_run import _ecef_origin, ns
from view_recordings import read_back

from replay.evaluate.compare import Method, make_method
from replay.evaluate.read import RunChannels
from replay.log.columns import Columns
from replay.time import NS_PER_S
from replay.view.compare_charts import distribution_chart
from replay.view.compare_recording import write_compared
from replay.view.compare_report import comparison_html, write_comparison
from replay.view.scenes import Stretch, choose_scenes


def method(name: str, **how: object) -> Method:
    made = fake_gnss.make_gnss(run=name, **how)
    data = RunChannels(
        run=name,
        solution=made[f"/solution/{name}"],
        truth=made["/truth"],
        geometry=made[f"/filter/{name}/geometry"],
        observations_ns=np.unique(made["/gnss/rover/obs"].valid_time_ns),
    )
    return make_method(data, log=Path(f"{name}.mcap"), name=name)


@pytest.fixture(scope="module")
def methods() -> list[Method]:
    return [method("rtk"), method("spp", sigma_m=0.8, seed=5, offset_m=(1.5, 0.0, 2.0))]


@pytest.fixture(scope="module")
def page(methods: list[Method]) -> str:
    return comparison_html(methods)


def test_the_page_has_table_curves_distribution_and_plan(page: str) -> None:
    labels = " ".join(re.findall(r"aria-label='([^']+)'", page))
    for words in (
        "Position error east", "Position change error up", "Cumulative distribution",
        "Trajectories of truth and all methods", "Trajectories in scenes", "Satellites used",
        "PDOP",
    ):  # fmt: skip
        assert words in labels, words
    assert "<td>rtk</td>" in page and "<td>spp</td>" in page
    assert "94.0" in page  # epochs with a solution, of all that were observed
    assert "http" not in re.sub(r"xmlns[:\w]*=\S+", "", page)
    assert len(page) < 1_000_000


def test_same_methods_same_page(page: str, methods: list[Method]) -> None:
    assert page == comparison_html(methods)


def test_scenes_that_a_person_chose(methods: list[Method]) -> None:
    start = int(methods[0].data.truth.valid_time_ns[0])
    chosen = [Stretch("Scene", start + 40 * NS_PER_S, start + 60 * NS_PER_S)]
    page = comparison_html(methods, scenes=chosen)
    assert "1 Scene, 40 to 60 s" in page and "Crossroads" not in page
    assert "closely" not in comparison_html(methods, scenes=[])


def test_the_distribution_reaches_all_epochs(methods: list[Method]) -> None:
    chart = distribution_chart(methods)
    assert chart is not None and "horizontal error [m]" in chart.svg
    far = method("far")
    elsewhere = RunChannels(
        run="far",
        solution=far.data.solution,
        truth=Columns.build(far.data.truth.valid_time_ns + 10**15, far.data.truth.values),
    )
    assert distribution_chart([make_method(elsewhere, log=Path("x"), name="x")]) is None


def test_the_recording_overlays_all_methods(methods: list[Method], tmp_path: Path) -> None:
    out = tmp_path / "compare.rrd"
    write_compared(methods, out)
    entities = read_back(out)
    for name in ("rtk", "spp"):
        for path in (
            f"/map/run/{name}/path", f"/world/run/{name}/path", f"/state/run/{name}",
            f"/plots/position_error/east/{name}", f"/plots/position_change_error/up/{name}",
            f"/plots/geometry/satellites/{name}", f"/plots/geometry/pdop/{name}",
        ):  # fmt: skip
            assert path in entities, path
    assert "/map/truth/path" in entities
    error = entities["/plots/position_error/east/spp"].values("Scalars:scalars")
    np.testing.assert_array_equal(error[np.isfinite(error)], methods[1].position.values[:, 0])
    about = entities["/about"].static["TextDocument:text"].to_pylist()[0][0]
    assert "| rtk |" in about and "run spp of spp.mcap" in about


def test_a_page_is_written_whole(methods: list[Method], tmp_path: Path, page: str) -> None:
    write_comparison(methods, tmp_path / "out.html")
    assert (tmp_path / "out.html").read_text() == page
    assert [p.name for p in tmp_path.iterdir()] == ["out.html"]


# scenes


def truth_of(speed: np.ndarray, turn_rad: np.ndarray) -> Columns:
    """Truth once a second of a vehicle with given speeds [m/s] and turns each second [rad]."""
    origin, axes = _ecef_origin()
    heading = np.cumsum(turn_rad)
    step = np.column_stack([speed * np.sin(heading), speed * np.cos(heading), 0.0 * speed])
    t = np.arange(float(len(speed)))
    values = {
        "position_ecef_m": origin + np.cumsum(step, axis=0) @ axes,
        "lever_arm_body_m": np.zeros((len(t), 3)),
        "quality": np.zeros(len(t), dtype=np.int32),
    }
    return Columns.build(ns(t), values)


def seconds(scene: Stretch) -> tuple[float, float]:
    start = int(ns(np.array([0.0]))[0])
    return ((scene.start_ns - start) / NS_PER_S, (scene.end_ns - start) / NS_PER_S)


def a_drive() -> tuple[np.ndarray, np.ndarray]:
    """A bend of 120 deg at 100 s; a stop at 300 s and a right angle after it."""
    speed, turn = np.full(600, 10.0), np.zeros(600)
    turn[100:106] = np.radians(20.0)
    speed[300:315] = 0.0
    speed[315:330] = 4.0
    turn[318:324] = np.radians(15.0)
    return speed, turn


def geometry_of(times: np.ndarray, count: np.ndarray) -> Columns:
    nought = np.zeros(len(times), dtype=np.uint32)
    values = {f"{s}_count": nought for s in ("glonass", "galileo", "beidou", "qzss")}
    return Columns.build(ns(times), {"gps_count": count.astype(np.uint32), **values})


def test_scenes_of_a_drive_are_where_they_were_put() -> None:
    times = np.arange(600.0)
    few = np.where((times >= 480) & (times < 510), 4, 10)
    scenes = choose_scenes(truth_of(*a_drive()), [geometry_of(times, few)])
    assert [s.title for s in scenes] == ["Curve", "Crossroads", "Fewest satellites"]
    (curve, curve_end), (cross, cross_end), (covered, covered_end) = map(seconds, scenes)
    assert curve < 103 < curve_end and curve_end - curve < 20
    assert cross < 318 and cross_end > 321
    assert 480 <= covered < covered_end <= 510


def test_epochs_without_any_satellite_are_the_fewest() -> None:
    times = np.arange(600.0)
    seen = (times < 430) | (times >= 455)
    scenes = choose_scenes(truth_of(*a_drive()), [geometry_of(times[seen], np.full(seen.sum(), 9))])
    start, end = seconds(scenes[-1])
    assert scenes[-1].title == "Fewest satellites"
    assert 425 <= (start + end) / 2 <= 460


def test_what_a_drive_does_not_have_is_not_shown() -> None:
    straight = truth_of(np.full(200, 10.0), np.zeros(200))
    assert choose_scenes(straight, []) == []
    parked = truth_of(np.zeros(200), np.zeros(200))
    assert choose_scenes(parked, [geometry_of(np.arange(200.0), np.full(200, 8))]) == []
    assert choose_scenes(straight.take(slice(0, 2)), []) == []
