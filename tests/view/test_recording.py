"""What is in the recording: entities, rows, times, places, ellipsoids."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import fake_run
import numpy as np
import pymap3d
import pytest
from view_recordings import Entity, read_back, unix_like

from replay.errors import ReplayError
from replay.log.columns import Columns, Ragged
from replay.view.recording import RecordingOptions, record

MM = 1e-3


def test_every_view_has_its_entities(entities: dict[str, Entity]) -> None:
    expected = {
        "/map/truth/path", "/map/gnss/rover/fixes", "/map/run/tight/path", "/map/run/tight/outage",
        "/world/truth/path", "/world/run/tight/path", "/world/run/tight/outage",
        "/world/run/tight/place", "/world/run/tight/place/body",
        "/state/gnss/rover", "/state/run/tight", "/events/tight", "/about",
        "/imu/angular_rate", "/imu/specific_force", "/imu/temperature",
        "/plots/nis/tight/nis", "/plots/gnss/satellites/rover",
    }  # fmt: skip
    expected |= {
        f"/plots/{kind}_error/{axis}/tight/{what}"
        for kind, axes in (
            ("position", ("east", "north", "up")),
            ("velocity", ("east", "north", "up")),
            ("attitude", ("roll", "pitch", "heading")),
        )
        for axis in axes
        for what in ("error", "bound")
    }
    expected |= {
        f"/plots/{sensor}/{axis}/tight/estimate"
        for sensor in ("gyro_bias", "accel_bias", "gyro_scale", "accel_scale")
        for axis in "xyz"
    }
    expected |= {
        f"/plots/innovations/tight/position/{axis}/accepted" for axis in ("east", "north", "up")
    }
    assert expected <= set(entities)


def test_no_row_is_lost_and_times_are_right_to_the_nanosecond(
    entities: dict[str, Entity], channels: dict[str, Columns]
) -> None:
    for path, topic in (
        ("/imu/angular_rate", "/imu/raw"),
        ("/world/run/tight/place", "/solution/tight"),
        ("/map/run/tight/now", "/solution/tight"),
        ("/map/gnss/rover/now", "/gnss/rover/fix"),
        ("/plots/velocity/east/truth", "/truth"),
        ("/plots/gyro_bias/x/tight/estimate", "/filter/tight/state"),
        ("/events/tight", "/filter/tight/events"),
    ):
        expected = unix_like(channels[topic].valid_time_ns)
        np.testing.assert_array_equal(entities[path].times_ns, expected, err_msg=path)
    # The calendar of GPS time: 2025-07-15 19:34:38.5 s + 123 456 789 ns of fake_run.START_NS.
    first = entities["/imu/angular_rate"].times_ns[0].astype("datetime64[ns]")
    assert str(first) == "2025-07-15T19:34:38.623456789"


def test_innovations_are_split_in_accepted_and_rejected(
    entities: dict[str, Entity], channels: dict[str, Columns]
) -> None:
    innovations = channels["/filter/tight/innovations"]
    counted = {
        what: sum(
            len(entity.times_ns)
            for path, entity in entities.items()
            if path.startswith("/plots/innovations/") and path.endswith(what)
        )
        for what in ("accepted", "rejected")
    }
    accepted = int(np.sum(innovations["accepted"]))
    assert counted == {"accepted": accepted, "rejected": len(innovations) - accepted}
    assert counted["rejected"] > 0


def test_plan_equals_pymap3d(entities: dict[str, Entity], channels: dict[str, Columns]) -> None:
    truth = channels["/truth"]["position_ecef_m"]
    lat, lon, height = pymap3d.ecef2geodetic(*truth[0])
    solution = channels["/solution/tight"]["position_ecef_m"]
    enu = np.column_stack(pymap3d.ecef2enu(*solution.T, lat, lon, height))
    place = entities["/world/run/tight/place"].values("Transform3D:translation").reshape(-1, 3)
    np.testing.assert_allclose(place, enu, atol=MM)
    here = np.column_stack(pymap3d.ecef2geodetic(*solution.T))[:, :2]
    now = entities["/map/run/tight/now"].values("GeoPoints:positions").reshape(-1, 2)
    np.testing.assert_allclose(now, here, atol=1e-9)


def test_ellipsoids_are_the_eigenvalues_of_the_covariance(
    entities: dict[str, Entity], channels: dict[str, Columns]
) -> None:
    path = next(p for p in entities if p.startswith("/world/run/tight/place/position_3_sigma"))
    factor = 3.0 * float(path.partition("_x")[2] or 1)
    entity = entities[path]
    sizes = entity.values("Ellipsoids3D:half_sizes").reshape(-1, 3) / factor
    xyzw = entity.values("Ellipsoids3D:quaternions").reshape(-1, 4)
    packed = channels["/solution/tight"]["position_covariance_enu_m2"]
    for row in (0, 700, len(packed) - 1):
        xx, xy, xz, yy, yz, zz = packed[row]
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        np.testing.assert_allclose(sizes[row] ** 2, np.linalg.eigvalsh(matrix), rtol=1e-4)
        x, y, z, w = xyzw[row]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        again = turn @ np.diag(sizes[row] ** 2) @ turn.T
        np.testing.assert_allclose(again, matrix, atol=2e-4 * np.trace(matrix))


def test_body_attitude_points_along_the_path(
    entities: dict[str, Entity], channels: dict[str, Columns]
) -> None:
    attitude = channels["/solution/tight"]["attitude_rad"]
    body = entities["/world/run/tight/place/body"]
    x, y, z, w = body.values("Transform3D:quaternion").reshape(-1, 4).T
    forward = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    pitch, heading = attitude[:, 1], attitude[:, 2]
    expected = np.column_stack(
        [np.cos(pitch) * np.sin(heading), np.cos(pitch) * np.cos(heading), np.sin(pitch)]
    )
    # 500 m away the local axes differ by 1e-4 rad.
    np.testing.assert_allclose(forward, expected, atol=3e-4)


def test_bands_are_three_sigmas(entities: dict[str, Entity], channels: dict[str, Columns]) -> None:
    band = entities["/plots/gyro_bias/y/tight/bound"].values("Scalars:scalars").reshape(-1, 2)
    covariance = channels["/filter/tight/covariance"]
    size = 21
    full = np.zeros((size, size))
    full[np.triu_indices(size)] = covariance.ragged("upper_triangle").row(40)
    sigma = np.sqrt(full[10, 10]) * 180 / np.pi * 3600
    assert band[40, 1] - band[40, 0] == pytest.approx(6 * sigma, rel=1e-12)


def test_outages_are_red_and_the_rest_is_not(
    entities: dict[str, Entity], channels: dict[str, Columns]
) -> None:
    red = entities["/plots/position_error/east/tight/error_in_outage"]
    seconds = (red.times_ns - unix_like(np.array([fake_run.START_NS]))) / 1e9
    assert seconds.min() >= 100.0 and seconds.max() <= 130.0 + 1e-6
    assert len(red.times_ns) == 300 + 1  # 10 Hz for 30 s, and the gap that ends it
    states = entities["/state/gnss/rover"].columns["StateChange:state"].to_pylist()
    assert ["no fix"] in states


@pytest.mark.parametrize(
    "missing",
    ["/truth", "/gnss/rover/fix", "/filter/tight/innovations", "/filter/tight/covariance",
     "/filter/tight/state", "/solution/tight", "/imu/raw", "/filter/tight/events"],
)  # fmt: skip
def test_a_missing_channel_gives_a_smaller_view(
    missing: str,
    channels: dict[str, Columns],
    reduced: Callable[..., dict[str, Entity]],
) -> None:
    rest = {topic: columns for topic, columns in channels.items() if topic != missing}
    entities = reduced(rest, {})
    assert "/about" in entities
    if missing == "/truth":
        assert "/plots/position_sigma/east/tight/sigma" in entities
        assert not any("error/" in path for path in entities)


def test_empty_channels_and_logs(
    channels: dict[str, Columns], reduced: Callable[..., dict[str, Entity]]
) -> None:
    empty = {topic: columns.take(slice(0, 0)) for topic, columns in channels.items()}
    some = empty | {"/truth": channels["/truth"]}
    assert "/map/truth/path" in reduced(some, {})


def test_no_rows_at_all(tmp_path: Path) -> None:
    out = tmp_path / "empty.rrd"
    record([], {}, out, name="empty")
    assert out.stat().st_size > 0


def test_an_unknown_channel_is_counted_and_not_drawn(
    channels: dict[str, Columns], reduced: Callable[..., dict[str, Entity]]
) -> None:
    strange = Columns.build(
        channels["/truth"].valid_time_ns[:3], {"text": Ragged.from_texts(["a", "b", "c"])}
    )
    entities = reduced({"/truth": channels["/truth"], "/lidar/points": strange}, {})
    about = entities["/about"].static["TextDocument:text"].to_pylist()[0][0]
    assert "| /lidar/points | 3 |" in about
    assert not any("lidar" in path for path in entities)


def test_positions_that_are_no_number_are_left_out_and_told(
    channels: dict[str, Columns], reduced: Callable[..., dict[str, Entity]]
) -> None:
    solution = channels["/solution/tight"]
    position = solution["position_ecef_m"].copy()
    position[5] = np.nan
    broken = Columns.build(solution.valid_time_ns, {**solution.values, "position_ecef_m": position})
    entities = reduced({"/solution/tight": broken}, {})
    about = entities["/about"].static["TextDocument:text"].to_pylist()[0][0]
    assert "1 rows have no finite position" in about
    assert len(entities["/world/run/tight/place"].times_ns) == len(solution) - 1


def test_several_runs_have_their_own_entities(
    reduced: Callable[..., dict[str, Entity]],
) -> None:
    runs = fake_run.make_channels(40.0, imu_hz=50, runs=("loose", "tight run"))
    entities = reduced(runs, {})
    assert "/plots/position_error/east/loose/error" in entities
    assert r"/plots/position_error/east/tight\ run/error" in entities


def test_a_thinned_path_says_so(
    channels: dict[str, Columns], metadata: dict[str, dict[str, str]], tmp_path: Path
) -> None:
    out = tmp_path / "thin.rrd"
    options = RecordingOptions(max_path_points=500, ellipsoid_exaggeration=7, imu=False)
    record(fake_run.in_batches(channels), metadata, out, name="thin", options=options)
    entities = read_back(out)
    assert "/map/truth/path_every_3th_point" in entities
    assert "/world/run/tight/place/position_3_sigma_x7" in entities
    assert "/imu/angular_rate" not in entities


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ReplayError, match="cannot be written"):
        record([], {}, tmp_path / "nowhere" / "run.rrd", name="x")


def test_the_viewer_verifies_the_file(recorded: Path) -> None:
    rerun = Path(sys.executable).parent / "rerun"
    done = subprocess.run(
        [str(rerun), "rrd", "verify", str(recorded)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_plan_is_seen_from_above_with_north_ahead() -> None:
    """An eye straight above needs north as its up: up as up turns the plan round."""
    from replay.view.blueprint import plan_eye

    eye = plan_eye(np.array([-10.0, -300.0, 0.0]), np.array([490.0, 100.0, 5.0]))
    position = eye.position.as_arrow_array().to_pylist()[0]
    target = eye.look_target.as_arrow_array().to_pylist()[0]
    assert position[:2] == target[:2] == pytest.approx([240.0, -100.0])
    assert position[2] > target[2] + 400.0
    assert eye.eye_up.as_arrow_array().to_pylist()[0] == [0.0, 1.0, 0.0]
