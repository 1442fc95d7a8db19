"""Times: every scale, leap seconds, exactness, the fit of ticks to host times."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

import numpy as np
import pytest
import small_recording

from replay import time
from replay.errors import ConfigurationError, ForeignFileError
from replay.importers.clock import valid_times
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.host_time import fit_ticks
from replay.importers.rtklib_tag import Tag, read_tag
from replay.importers.spec import Time
from replay.importers.table import Table

GPS_2025 = time.from_calendar(datetime.datetime(2025, 7, 8, 19, 34, 21))


def read(
    spec: Time, scale: str = "", **columns: Sequence[float] | Sequence[str]
) -> tuple[list[int], list[bool]]:
    texts = {k: list(map(str, v)) for k, v in columns.items() if isinstance(v[0], str)}
    numbers = {k: np.array(v, dtype=float) for k, v in columns.items() if k not in texts}
    count = len(next(iter(columns.values())))
    table = Table(File("t.csv", b"", "", 0), numbers, texts, np.arange(1, count + 1), scale)
    ns, good = valid_times(table, spec, _no_tag, lambda _: None)
    return ns.tolist(), good.tolist()


def _no_tag(name: str) -> Tag:
    raise AssertionError(name)


def test_gps_week() -> None:
    week, tow = 2374, 2 * 86400 + 70461.123456789
    expected = GPS_2025 + 123456789
    assert read(Time(columns=("w", "s"), scale="gps_week"), w=[week], s=[tow])[0][0] == (
        pytest.approx(expected, abs=30)
    )
    assert read(Time(columns=("s",), scale="gps_week", week=week), s=[0.5])[0] == [
        week * time.NS_PER_WEEK + 500_000_000
    ]


def test_gps_and_utc_calendars_differ_by_leap_seconds() -> None:
    text = ["2025/07/08 19:34:21.123456789"]
    gps, _ = read(Time(columns=("t",), scale="gps_calendar"), t=text)
    utc, _ = read(Time(columns=("t",), scale="utc_calendar"), t=["2025-07-08T19:34:21.123456789Z"])
    assert gps == [GPS_2025 + 123456789]
    assert utc[0] - gps[0] == 18_000_000_000


def test_leap_seconds_follow_the_date() -> None:
    spec = Time(columns=("t",), scale="utc_calendar")
    utc, _ = read(spec, t=["2016-12-31T23:59:59", "2017-01-01T00:00:00"])
    assert utc[1] - utc[0] == 2_000_000_000  # the second 23:59:60 lies between


def test_unix_seconds_are_read_exactly() -> None:
    spec = Time(columns=("t",), scale="unix")
    ns, good = read(spec, t=["1752003261.123456789", "1e999", "abc"])
    assert ns[0] == GPS_2025 + 123456789 + 18_000_000_000
    assert good == [True, False, False]
    spec = Time(columns=("t",), scale="unix", unit="ms")
    assert read(spec, t=["1752003261123"])[0] == [GPS_2025 + 123_000_000 + 18_000_000_000]


def test_relative_times_offset_and_bad_rows() -> None:
    spec = Time(columns=("t",), scale="relative", epoch="2025-07-08T19:34:21", offset=-0.25)
    ns, good = read(spec, t=[-0.082, 2148.7, float("nan"), 1e30])
    assert ns[:2] == [GPS_2025 - 332_000_000, GPS_2025 + 2_148_450_000_000]
    assert good == [True, True, False, False]


def test_a_text_that_is_no_date_spoils_its_row_only() -> None:
    spec = Time(columns=("t",), scale="gps_calendar")
    _, good = read(spec, t=["2025-07-08 19:34:21", "yesterday", ""])
    assert good[:2] == [True, False]


def test_the_file_and_the_spec_must_agree_on_the_scale() -> None:
    with pytest.raises(ForeignFileError, match="the file says UTC"):
        read(Time(columns=("t",), scale="gps_calendar"), "UTC", t=["2025-07-08 19:34:21"])


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (Time(columns=("t",), scale="gps_week"), "takes 2 column"),
        (Time(columns=("t", "u"), scale="relative"), "takes 1 column"),
        (Time(columns=("t",), scale="relative"), "no date"),
        (Time(columns=("t",), scale="ticks"), "need a host_tag"),
    ],
)
def test_an_incomplete_time_is_told(spec: Time, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        read(spec, t=[1.0], u=[2.0])


@pytest.mark.parametrize("method", ["linear", "span"])
def test_the_fit_is_exact_on_a_straight_line(method: str) -> None:
    lines = small_recording.imu_lines()
    tag = read_tag(File("t", small_recording.tag_bytes(lines), "", 0), Findings())
    file = File("t", "\n".join(lines).encode(), "", 0)
    ticks = small_recording.TICKS.astype(float)
    fit = fit_ticks(tag, file.recorded_ends(2), ticks, method, "t")  # type: ignore[arg-type]
    assert fit.scale == 1.25 and fit.residual_ms == 0.0 and fit.pairs == 200
    elapsed = (1.25 * (ticks - 1000) + 100) * 1e6
    np.testing.assert_array_equal(fit.times_ns(tag, ticks) - tag.start_ns, elapsed.astype(np.int64))


def test_least_squares_agree_with_numpy_and_wrong_line_ends_show() -> None:
    rng = np.random.default_rng(3)
    ends = np.cumsum(rng.integers(30, 60, 500))
    ticks = np.cumsum(rng.integers(8, 12, 500)).astype(float)
    elapsed = np.sort((ticks * 1.00001 + rng.normal(0, 3, 500)).astype(np.int64) + 500)
    fit = fit_ticks(Tag(0, elapsed, ends), ends, ticks, "linear", "t")
    slope, start = np.polyfit(ticks, elapsed, 1)
    assert fit.scale == pytest.approx(slope, rel=1e-12)
    assert fit.times_ns(Tag(0, elapsed, ends), np.zeros(1))[0] == pytest.approx(start * 1e6, abs=5)
    wrong = fit_ticks(Tag(0, elapsed, ends), ends - np.arange(500), ticks, "linear", "t")
    assert abs(wrong.scale - 1.0) > 100 * abs(fit.scale - 1.0)


def test_ticks_that_cannot_be_paired() -> None:
    tag = Tag(0, np.array([1, 2]), np.array([5, 9]))
    with pytest.raises(ForeignFileError, match="fewer than two ticks can be paired"):
        fit_ticks(tag, np.array([100, 200]), np.array([1.0, 2.0]), "linear", "t")
