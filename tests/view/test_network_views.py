"""Views of a network: what a run's recording shows of it, and charts of layout and trajectory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.evaluate.errors_enu import Errors
from replay.evaluate.network_residuals import Observed, rover_residuals
from replay.log.columns import Columns
from replay.view.blueprint import NETWORK
from replay.view.gather import RunData, gather
from replay.view.network_charts import Track, layout_chart, trajectory_chart
from replay.view.network_panels import (
    correction_panels,
    impact_panels,
    network_panels,
    residual_panels,
    satellite_inks,
    satellites_of,
    shifted,
    state_panels,
)
from replay.view.network_scene import station_positions
from replay.view.network_solution import difference_panels, navigation_parameter_panels
from replay.view.palette import run_ink
from replay.view.panels import Section
from replay.view.recording import RecordingOptions, all_panels, record
from replay.view.report import report_html
from tests.batch import fake_network
from tests.batch.fake_network import CHANGE_S, LEFT_M, SATELLITES, SIGNALS, STATIONS
from tests.view import fake_run
from tests.view.fake_run import ns
from tests.view.view_recordings import read_back

RUN_S = 110.0


@pytest.fixture(scope="module")
def made() -> dict[str, Columns]:
    return fake_network.make_network(RUN_S)


@pytest.fixture(scope="module")
def data(made: dict[str, Columns]) -> RunData:
    return gather([made], fake_network.make_metadata())


def test_every_baseline_and_signal_has_a_panel_with_all_satellites(data: RunData) -> None:
    panels = {p.key: p for p in network_panels(data)}
    for baseline in fake_network.BASELINES:
        for signal in SIGNALS:
            curves = {c.key for c in panels[f"network/{baseline}/{signal}"].curves}
            used = [s for s in SATELLITES if not (baseline == "ref1-ref2" and s == "G29")]
            assert curves == {f"{s}{w}" for s in used for w in ("", "_residual")}
    for signal in SIGNALS:
        assert len(panels[f"network/rover/corrections/{signal}"].curves) == len(SATELLITES)


def test_a_line_ends_where_the_reference_satellite_changes(made: dict[str, Columns]) -> None:
    errors = made["/network/mref-ref1/errors"]
    panels = state_panels(errors, "G08", "1C", run_ink(0), key="x")
    assert [p.unit for p in panels[::2]] == ["cm", "mm/s", "µm/s²", "cm"]
    line = panels[0].curves[0]
    gap = line.times_ns[np.isnan(line.values)]
    assert len(gap) == 1
    at = CHANGE_S - 0.5
    assert ns(np.array([at]))[0] <= gap[0] <= ns(np.array([at + 1.0]))[0]
    assert line.values[0] == pytest.approx(
        100.0 * fake_network._World(RUN_S, 5).difference(
            "ref1", "mref", "G08", np.full(107, "G05"), "1C"
        )[0]
    )  # fmt: skip


def test_residual_and_filtered_error_of_one_satellite(made: dict[str, Columns]) -> None:
    panels = impact_panels(
        made["/network/mref-ref1/residuals"], made["/network/mref-ref1/errors"], "G08",
        run_ink(0), key="x",
    )  # fmt: skip
    assert [p.title for p in panels[::2]] == ["G08 1C", "G08 2W"]
    raw, filtered = panels[0].curves
    away = raw.values - filtered.values[np.isfinite(filtered.values)]
    np.testing.assert_allclose(panels[1].curves[0].values, away)
    assert 0.45 < float(np.std(away)) < 0.75  # cm; 6 mm were put in


def test_corrections_leave_the_reference_out(made: dict[str, Columns]) -> None:
    corrections = made["/network/rover/corrections"]
    inks = satellite_inks(satellites_of(corrections))
    panels = correction_panels(corrections, inks, key="k", row="rover")
    times = {c.key: c.times_ns for p in panels[:1] for c in p.curves}
    change = ns(np.array([CHANGE_S]))[0]
    assert (times["G05"] > change).all() and (times["G12"] < change).all()


def test_rover_residuals_before_and_after(made: dict[str, Columns]) -> None:
    sides = [
        Observed(
            made[f"/gnss/{name}/obs"], made[f"/gnss/{name}/corrections"],
            made[f"/truth/{name}/signals"],
        )
        for name in ("rover", "mref")
    ]  # fmt: skip
    residuals = rover_residuals(*sides, made["/network/rover/corrections"])
    found = residual_panels(residuals, {}, key="k", title="Case 1")
    assert set(found) == set(SIGNALS)
    for before, after in found.values():
        assert "before" in before.title and "after" in after.title
        for curve in after.curves:
            values = curve.values[np.isfinite(curve.values)]
            np.testing.assert_allclose(values, 100.0 * LEFT_M, atol=3e-5)


def test_panels_at_another_time(data: RunData) -> None:
    first = network_panels(data)[0]
    moved = shifted(first, 5)
    for a, b in zip(first.curves, moved.curves, strict=True):
        np.testing.assert_array_equal(b.times_ns - a.times_ns, 5)


def test_inks_of_many_satellites_differ() -> None:
    names = [f"G{i:02d}" for i in range(1, 13)]
    inks = satellite_inks(names)
    assert len({ink.hexadecimal for ink in inks.values()}) == len(names)


def test_stations_are_the_ends_of_baselines_the_master_first(data: RunData) -> None:
    assert list(station_positions(data)) == list(STATIONS)


def test_navigation_parameters_and_differences() -> None:
    solution = fake_run.make_channels(60.0, imu_hz=10)["/solution/tight"]
    panels = navigation_parameter_panels(solution, key="n")
    assert [p.key.split("/")[1] for p in panels] == ["position"] * 3 + ["velocity"] * 3 + [
        "attitude"
    ] * 3
    heading = next(p for p in panels if p.key.endswith("heading")).curves[0].values
    assert np.nanmin(heading) >= 0.0 and np.nanmax(heading) < 360.0
    rows = np.arange(3)
    errors = Errors(rows, ns(rows.astype(float)), np.tile([0.01, 0.02, 0.03], (3, 1)))
    (difference,) = difference_panels({"network": errors}, key="d", title="Case 1")
    values = {c.key: c.values[0] for c in difference.curves}
    assert values == pytest.approx({"north": 2.0, "east": 1.0, "height": 3.0})


def test_layout_tells_names_and_distances(data: RunData) -> None:
    assert data.truth is not None
    tracks = [Track.of("Case 1", data.truth)]
    chart = layout_chart(station_positions(data), tracks)
    for name in STATIONS:
        assert f">{name}<" in chart.svg
    east, north = (np.subtract(STATIONS["ref1"], STATIONS["mref"])) / 1000.0
    assert f"{np.hypot(east, north):.1f} km" in chart.svg
    assert "Case 1 49.9 to 50" in chart.caption or "Case 1 50" in chart.caption
    space = trajectory_chart([*tracks, *tracks])
    assert space.svg.count("height above the ellipsoid") == 2
    assert chart == layout_chart(station_positions(data), tracks)


def test_the_recording_of_a_run_shows_its_network(made: dict[str, Columns], tmp_path: Path) -> None:
    out = tmp_path / "network.rrd"
    metadata = fake_network.make_metadata()
    options = RecordingOptions(active_tab=NETWORK)
    record(fake_run.in_batches(made), metadata, out, name="network", options=options)
    entities = read_back(out)
    for path in (
        "/map/stations", "/world/stations", "/world/baselines",
        "/plots/network/mref-ref1/1C/G08", "/plots/network/rover/corrections/2W/G20",
    ):  # fmt: skip
        assert path in entities, path
    assert len(entities["/world/stations"].static["Points3D:positions"].to_pylist()[0]) == 4


def test_a_run_without_a_network_is_as_it_was() -> None:
    channels = fake_run.make_channels(40.0, imu_hz=10)
    plain = gather([channels], {})
    assert network_panels(plain) == [] and station_positions(plain) == {}
    sections = {panel.section for panel in all_panels(plain)}
    assert not sections & {Section.NETWORK_CORRECTIONS, Section.NETWORK_ERRORS}


def test_the_report_of_a_run_has_its_network(made: dict[str, Columns]) -> None:
    page = report_html([made], fake_network.make_metadata(), title="network")
    assert "Network of reference stations" in page
    assert "mref-ref1 1C: residuals (dots) and filtered errors" in page
