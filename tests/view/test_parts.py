"""Outages, standard deviations, thinning, pictures: the small parts."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest

from replay.errors import LogError, ReplayError
from replay.evaluate.outages import Span
from replay.log.columns import Columns, Ragged
from replay.time import NS_PER_S
from replay.view import picture
from replay.view.about import manifest_of
from replay.view.filter_panels import nis_of
from replay.view.outages import find_outages, inside
from replay.view.picture import render_png
from replay.view.thinning import dot_stride, line_rows
from replay.view.uncertainty import attitude_angle_sigmas, join_sigmas, sigmas_of

S = NS_PER_S


def test_gaps_are_outages_and_cut_ones_are_told_once() -> None:
    times = np.concatenate([np.arange(0, 50), np.arange(80, 120), np.arange(140, 150)]) * S
    record = {"outages": [{"start_ns": 49 * S, "end_ns": 79 * S}]}
    found = find_outages({"replay.degrade": {"json": json.dumps(record)}}, [times], 160 * S)
    assert found == (
        Span(49 * S, 79 * S, cut=True),
        Span(119 * S, 140 * S),
        Span(149 * S, 160 * S),
    )
    assert inside(np.array([48, 49, 79, 80]) * S, found).tolist() == [False, True, True, False]


def test_one_lost_fix_is_no_outage() -> None:
    times = np.delete(np.arange(100), [50, 51]) * S
    assert find_outages({}, [times], 99 * S) == ()
    assert find_outages({}, [], 99 * S) == ()


def test_sigmas_follow_the_names_when_states_come_and_go() -> None:
    names = ["a_x,gyro_bias_x", "gyro_bias_x,b_x,c_x", "a_x,gyro_bias_x"]
    triangles = [[4.0, 0.5, 9.0], [16.0, 0, 0, 1, 0, 1], [25.0, 0.0, 36.0]]
    offsets = np.cumsum([0, 3, 6, 3]).astype(np.int64)
    columns = Columns.build(
        [1, 2, 3],
        {
            "dimension": np.array([2, 3, 2], dtype=np.uint32),
            "state_names": Ragged.from_texts(names),
            "upper_triangle": Ragged(offsets, np.concatenate(triangles)),
        },
    )
    sigmas = sigmas_of(columns)
    at = sigmas.at(np.array([1, 2, 3, 4]), "gyro_bias", ("_x",))
    np.testing.assert_array_equal(at, [3.0, 4.0, 6.0, np.nan])
    joined = join_sigmas(
        [sigmas_of(columns.take(slice(2, 3))), sigmas_of(columns.take(slice(0, 2)))]
    )
    np.testing.assert_array_equal(joined.times_ns, [1, 2, 3])
    np.testing.assert_array_equal(joined.values["a_x"], [2.0, np.nan, 5.0])
    assert np.isnan(sigmas.at(np.array([1]), "accel_bias", ("_x",))).all()


def test_angle_sigmas_equal_a_sample() -> None:
    """Small rotations about east, north, up, turned into angles by scipy."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(3)
    rpy = np.radians([[12.0, -35.0, 200.0]])
    std = np.radians([[0.02, 0.05, 0.03]])
    small = rng.standard_normal((20_000, 3)) * std
    ned = small[:, [1, 0, 2]] * [1, 1, -1]
    turned = Rotation.from_rotvec(ned) * Rotation.from_euler("ZYX", rpy[:, ::-1])
    spread = turned.as_euler("ZYX")[:, ::-1].std(axis=0)
    np.testing.assert_allclose(attitude_angle_sigmas(rpy, std)[0], spread, rtol=0.02)


def test_nis_is_a_sum_per_epoch_of_what_was_accepted() -> None:
    columns = Columns.build(
        [1, 1, 1, 2],
        {
            "normalized": np.array([1.0, 2.0, 9.0, 3.0]),
            "accepted": np.array([True, True, False, True]),
        },
    )
    nis = nis_of(columns)
    np.testing.assert_array_equal(nis.values, [5.0, 9.0])
    np.testing.assert_array_equal(nis.degrees, [2, 1])
    np.testing.assert_allclose(nis.bounds()[1], [0.000982, 5.0239], rtol=1e-3)  # tables of chi2


def test_thinning_keeps_peaks_and_gaps() -> None:
    values = np.sin(np.arange(100_000) / 500.0)
    values[43_210], values[77_777], values[60_000] = 9.0, -9.0, np.nan
    rows = line_rows(values, 200)
    assert len(rows) <= 801
    assert {0, 43_210, 60_000, 77_777, 99_999} <= set(rows.tolist())
    assert dot_stride(1000, 1000) == 1 and dot_stride(1001, 1000) == 2


def test_a_manifest_that_is_none() -> None:
    assert manifest_of({}) is None
    with pytest.raises(LogError, match="manifest"):
        manifest_of({"replay.manifest": {"json": "{no"}})


def test_a_picture_of_nothing(tmp_path: Path) -> None:
    with pytest.raises(ReplayError, match="no such recording"):
        render_png(tmp_path / "none.rrd", tmp_path / "none.png")


def test_a_viewer_without_a_driver_tells_the_mend_and_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(picture.sys, "executable", str(tmp_path / "python"))
    (tmp_path / "rerun").write_text("#!/bin/sh\necho 'No graphics adapter was found'\nexit 101\n")
    os.chmod(tmp_path / "rerun", 0o755)
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    with pytest.raises(ReplayError, match="mesa-vulkan-drivers"):
        render_png(tmp_path / "run.rrd", tmp_path / "run.png", timeout_s=10)
    assert not (tmp_path / "run.png").exists()


def test_a_viewer_that_hangs_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture.sys, "executable", str(tmp_path / "python"))
    (tmp_path / "rerun").write_text(f"#!/bin/sh\nsleep 600 &\necho $! > {tmp_path}/child\nwait\n")
    os.chmod(tmp_path / "rerun", 0o755)
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    with pytest.raises(ReplayError, match="steady picture in time"):
        render_png(tmp_path / "run.rrd", tmp_path / "run.png", timeout_s=1)
    child = int((tmp_path / "child").read_text())
    # A busy machine takes a moment to carry out a kill.
    deadline = time.monotonic() + 10.0
    while _runs(child) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not _runs(child)


def _runs(process: int) -> bool:
    try:
        return ") Z" not in Path(f"/proc/{process}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def _has_driver() -> bool:
    return any(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*.json"))


@pytest.mark.skipif(not _has_driver(), reason="no software Vulkan driver")
def test_a_picture(recorded: Path, tmp_path: Path) -> None:
    from PIL import Image

    out = tmp_path / "run.png"
    render_png(recorded, out, width=800, height=600)
    with Image.open(out) as image:
        assert image.size == (800, 600)
        assert len(image.convert("RGB").getcolors(1 << 20) or []) > 50
