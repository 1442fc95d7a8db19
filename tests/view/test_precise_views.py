"""Runs of precise point positioning: what their recordings and pages hold."""

from __future__ import annotations

import re
from pathlib import Path

import fake_ppp
import fake_run
import numpy as np
import pytest
from view_recordings import Entity, read_back

from replay.evaluate import RunChannels, evaluate_channels
from replay.log.columns import Columns
from replay.view.convergence_panels import convergence_panels
from replay.view.gather import gather
from replay.view.key_figures import headline, tables
from replay.view.panels import Section
from replay.view.precise_panels import less_last, precise_panels
from replay.view.recording import RecordingOptions, record
from replay.view.report import report_html


@pytest.fixture(scope="module")
def ppp() -> dict[str, Columns]:
    return fake_ppp.make_ppp()


@pytest.fixture(scope="module")
def entities(
    ppp: dict[str, Columns], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Entity]:
    out = tmp_path_factory.mktemp("ppp") / "run.rrd"
    record(fake_run.in_batches(ppp), {}, out, name="ppp")
    return read_back(out)


@pytest.fixture(scope="module")
def page(ppp: dict[str, Columns]) -> str:
    return report_html(fake_run.in_batches(ppp), {}, title="ppp")


def test_entities_of_what_is_estimated(entities: dict[str, Entity]) -> None:
    expected = {
        "/plots/troposphere/ppp/wet/wet", "/plots/troposphere/ppp/wet/wet_bound",
        "/plots/troposphere/ppp/gradient/north", "/plots/troposphere/ppp/gradient/east_bound",
        "/plots/troposphere/ppp/hydrostatic/hydrostatic",
        "/plots/ionosphere/ppp/estimate/G08", "/plots/ionosphere/ppp/sigma/E03",
        "/plots/receiver_biases/ppp/estimate/G_2W", "/plots/receiver_biases/ppp/sigma/E_5Q",
        "/plots/phases/ppp/estimate/G08_1C", "/plots/phases/ppp/sigma/C20_2W",
        "/plots/phases/ppp/count/all", "/plots/phases/ppp/count/new",
        "/plots/convergence/ppp/enu/east", "/plots/convergence/ppp/size/up",
        "/plots/convergence/ppp/status/float", "/plots/convergence/ppp/status/fixed",
        "/plots/corrections/rover/satellite_antenna/G08", "/plots/corrections/rover/solid_tide/G08",
        "/plots/corrections/rover/wind_up/G08", "/plots/corrections/rover/phase_bias/G08",
    }  # fmt: skip
    assert expected <= set(entities)
    for absent in ("pole_tide", "ocean_loading", "higher_ionosphere"):
        assert not any(absent in path for path in entities), absent


def test_values_are_those_of_the_channels(
    entities: dict[str, Entity], ppp: dict[str, Columns]
) -> None:
    rows = ppp["/filter/ppp/troposphere"]
    wet = entities["/plots/troposphere/ppp/wet/wet"].values("Scalars:scalars")
    np.testing.assert_array_equal(wet, rows["wet_m"])
    bound = entities["/plots/troposphere/ppp/wet/wet_bound"].values("Scalars:scalars")
    np.testing.assert_allclose(
        bound.reshape(-1, 2),
        np.column_stack([wet - 3 * rows["wet_std_m"], wet + 3 * rows["wet_std_m"]]),
    )
    bias = entities["/plots/receiver_biases/ppp/estimate/G_2W"].values("Scalars:scalars")
    assert set(bias.tolist()) == {-0.7}
    tide = entities["/plots/corrections/rover/solid_tide/G08"].values("Scalars:scalars")
    assert set(tide.tolist()) == {fake_ppp.ADDED["solid_tide_m"]}
    terms = ppp["/gnss/rover/corrections"]
    assert terms.is_present("wind_up_m").all()


def test_ambiguities_come_down_to_nought_in_each_arc(entities: dict[str, Entity]) -> None:
    other = entities["/plots/phases/ppp/estimate/G10_1C"].values("Scalars:scalars")
    assert other[-1] == 0.0 and (np.diff(other) < 0.0).all()
    anew = entities["/plots/phases/ppp/estimate/G08_1C"].values("Scalars:scalars")
    jumps = np.flatnonzero(np.diff(anew) > 0.0)
    assert len(jumps) == 1  # not of 300 m: each arc has its own end
    assert anew.max() < 1.0 and anew[jumps[0]] == anew[-1] == 0.0
    begun = entities["/plots/phases/ppp/count/new"].values("Scalars:scalars")
    every = len(fake_ppp.SATELLITES) * len(fake_ppp.SIGNALS)
    np.testing.assert_array_equal(begun, [every, len(fake_ppp.SIGNALS)])


def test_less_last_of_arcs() -> None:
    values = np.array([3.0, 2.0, 1.0, 10.0, 12.0, 7.0])
    found = less_last(values, np.array([1, 2, 4, 1, 2, 1]))
    np.testing.assert_array_equal(found, [2.0, 1.0, 0.0, -2.0, 0.0, 0.0])


def test_convergence_is_the_error_and_its_logarithm(entities: dict[str, Entity]) -> None:
    t = np.arange(0.0, 7200.0, fake_ppp.STEP_S)
    enu = fake_ppp.errors(t)
    east = entities["/plots/convergence/ppp/enu/east"].values("Scalars:scalars")
    np.testing.assert_allclose(east, enu[:, 0], atol=1e-6)
    up = entities["/plots/convergence/ppp/size/up"].values("Scalars:scalars")
    size = np.maximum(np.abs(enu[:, 2]), 1e-4)
    np.testing.assert_allclose(up, np.log10(size), atol=2e-3)
    limit = entities["/plots/convergence/ppp/size/limit"].values("Scalars:scalars")
    np.testing.assert_allclose(limit, -1.0)
    fixed = entities["/plots/convergence/ppp/status/fixed"]
    assert len(fixed.times_ns) == np.count_nonzero(t >= fake_ppp.FIX_S)


def test_a_rover_that_moves_has_no_convergence() -> None:
    data = gather(fake_run.in_batches(fake_ppp.make_gnss()), {})
    assert convergence_panels(data) == [] and precise_panels(data) == []


def test_a_place_that_is_given_stands_for_truth(ppp: dict[str, Columns], tmp_path: Path) -> None:
    rest = {topic: columns for topic, columns in ppp.items() if topic != "/truth"}
    x, y, z = ppp["/truth"]["position_ecef_m"][0]
    out = tmp_path / "given.rrd"
    record(
        fake_run.in_batches(rest), {}, out, name="x", options=RecordingOptions(reference=(x, y, z))
    )
    assert "/plots/convergence/ppp/enu/up" in read_back(out)
    assert "Convergence</h2>" in report_html(
        fake_run.in_batches(rest), {}, title="x", reference="mean"
    )
    assert "Convergence</h2>" not in report_html(fake_run.in_batches(rest), {}, title="x")


def test_the_page_has_the_sections(page: str, ppp: dict[str, Columns]) -> None:
    for section in (Section.CONVERGENCE, Section.PHASES):
        assert f"{section.value}</h2>" in page
    for words in ("Zenith wet delay", "Gradients", "Slant ionosphere", "code bias", "Wind-up"):
        assert words in page
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL).lower()
    assert page == report_html(fake_run.in_batches(ppp, 900.0), {}, title="ppp")


@pytest.mark.parametrize(
    "missing",
    ["troposphere", "ionosphere", "receiver_biases", "phases"],
)
def test_what_is_missing_is_left_out(missing: str, ppp: dict[str, Columns]) -> None:
    rest = {topic: rows for topic, rows in ppp.items() if not topic.endswith(missing)}
    panels = precise_panels(gather([rest], {}))
    assert panels and not any(panel.key.startswith(missing) for panel in panels)


def test_figures_of_a_station(ppp: dict[str, Columns]) -> None:
    """Up is the last within: 0.9 m exp(-t / 600 s) and some millimetres."""
    solution = ppp["/solution/ppp"]
    found = evaluate_channels(RunChannels("ppp", solution, ppp["/truth"])).to_json_dict()
    t = np.arange(0.0, 7200.0, fake_ppp.STEP_S)
    outside = np.flatnonzero(np.abs(fake_ppp.errors(t)).max(axis=1) > 0.1)
    minutes = f"{t[outside[-1] + 1] / 60.0:.1f}"
    tiles = {label: value for label, value, _ in headline(found)}
    assert tiles["Within 10 cm for good after"] == minutes
    late = t >= 3600.0
    std = 1e3 * fake_ppp.errors(t)[late].std(axis=0)
    assert tiles["Std E / N / U"] == " / ".join(f"{value:.1f}" for value in std)
    heads = [table.head[0] for table in tables(found)]
    assert any("minutes until errors keep within 0.1 m" in head for head in heads)
    assert "stands still [mm]" in heads
