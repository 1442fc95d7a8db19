"""Rows of observations to records: which signal fills which slot, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.errors import ConfigurationError
from replay.gnss.measurements import SATELLITE_NAMES, gather_epochs, select_signals, signal_names
from replay.log.columns import Columns

C = 299792458.0
L1, L2, L5 = 1575.42e6, 1227.60e6, 1176.45e6
SECOND = 1_000_000_000
NAN = float("nan")


def observations(rows, *, log=None):
    """Columns of (time, satellite, signal, code, phase, doppler[, channel])."""
    times = np.array([r[0] for r in rows], dtype=np.int64)
    n = len(rows)
    channel = [r[6] if len(r) > 6 else None for r in rows]
    return Columns.build(
        times,
        {
            "satellite": np.array([r[1] for r in rows], dtype="S3"),
            "signal": np.array([r[2] for r in rows], dtype="S2"),
            "pseudorange_m": np.array([r[3] for r in rows], dtype=float),
            "carrier_phase_cycles": np.array([r[4] for r in rows], dtype=float),
            "doppler_hz": np.array([r[5] for r in rows], dtype=float),
            "cn0_dbhz": np.full(n, 45.0),
            "lock_time_s": np.full(n, 7.0),
            "loss_of_lock": np.ones(n, dtype=np.uint32),
            "glonass_channel": np.array([c or 0 for c in channel], dtype=np.int32),
        },
        log_time_ns=times if log is None else np.array(log, dtype=np.int64),
        present={"glonass_channel": np.array([c is not None for c in channel])},
    )


def one(rows, signals, systems="GRECJ"):
    """Record of the one satellite of some rows."""
    found = gather_epochs(observations(rows), select_signals(signals, systems))
    assert len(found.rows) == 1
    return found.rows[0]


def names(record):
    return [n.decode() for n in signal_names(record["signal"])]


SIGNALS = ["G1C", "G1W", "G2W", "G2L", "G5Q", "E1C", "R1C", "R2C"]


def test_a_record_holds_metres():
    row = one([(0, "G05", "1C", 2.2e7, 1e8, -1500.0)], SIGNALS)
    assert row["satellite"] == 4
    assert row["system"] == 0
    assert row["prn"] == 5
    assert names(row) == ["1C", "--", "--"]
    assert row["frequency"][0] == L1
    assert row["code"][0] == 2.2e7
    assert row["phase"][0] == pytest.approx(1e8 * C / L1, rel=1e-15)
    # A positive Doppler approaches: the range shrinks.
    assert row["range_rate"][0] == pytest.approx(1500.0 * C / L1, rel=1e-15)
    assert row["cn0"][0] == 45.0
    assert row["lock_time"][0] == 7.0
    assert row["lock_lost"][0] == 1
    assert np.isnan(row["code"][1:]).all()


def test_codes_of_clocks_replace_codes_and_nothing_else():
    rows = [
        (0, "E11", "1C", 2.4e7, 1.1e8, 10.0),
        (0, "G05", "1C", 2.2e7, 1e8, -1500.0),
        (0, "G05", "1W", 2.2e7 + 1.4, NAN, NAN),
        (0, "G05", "2W", 2.2e7 + 3.0, 8e7, -1200.0),
        (SECOND, "G05", "1C", 2.3e7, 1e8, -1500.0),  # without the clocks' code
        (SECOND, "G07", "1C", NAN, 1e8, -1500.0),
        (SECOND, "G07", "1W", 2.5e7, NAN, NAN),
    ]
    plain = gather_epochs(observations(rows), select_signals(SIGNALS, "GE"))
    codes = select_signals(["G2W", "G1W"], "GE")  # slots are told apart by frequency
    found = gather_epochs(observations(rows), select_signals(SIGNALS, "GE"), codes=codes)
    satellites = [SATELLITE_NAMES[row["satellite"]].decode() for row in found.rows]
    first, second = slice(0, 2), slice(2, 4)
    assert sorted(satellites[first]) == ["E11", "G05"]
    assert sorted(satellites[second]) == ["G05", "G07"]
    values = dict(zip(satellites[first], found.rows["code"][first].tolist(), strict=True))
    assert values["G05"][:2] == [2.2e7 + 1.4, 2.2e7 + 3.0]
    assert values["E11"][0] == 2.4e7
    values = dict(zip(satellites[second], found.rows["code"][second].tolist(), strict=True))
    assert values["G05"][0] == 2.3e7
    assert values["G07"][0] == 2.5e7
    for name in found.rows.dtype.names:
        if name != "code":
            np.testing.assert_array_equal(found.rows[name], plain.rows[name])


@pytest.mark.parametrize(
    ("tracked", "slots"),
    [
        (["1C", "2W", "5Q"], ["1C", "2W", "5Q"]),
        (["1C", "2L", "5Q"], ["1C", "2L", "5Q"]),  # the second of a band stands in
        (["1C", "2L", "2W"], ["1C", "2W", "--"]),  # the first of the list comes first
        (["1W", "5Q"], ["1W", "--", "5Q"]),  # a missing band leaves its slot empty
        (["2X", "5I"], ["--", "--", "--"]),  # not asked for
        (["1C", "1W"], ["1C", "--", "--"]),
    ],
)
def test_which_signal_fills_which_slot(tracked, slots):
    rows = [(0, "G05", s, 2.2e7, 1e8, 0.0) for s in sorted(tracked)]
    found = gather_epochs(observations(rows), select_signals(SIGNALS, "G"))
    if slots == ["--"] * 3:
        assert len(found.rows) == 0
        assert len(found.epochs) == 1  # the epoch was, all the same
    else:
        assert names(found.rows[0]) == slots


def test_a_range_is_worth_more_than_rank():
    rows = [(0, "G05", "1C", 2.2e7, 1e8, 0.0), (0, "G05", "2L", 2.3e7, 1e8, 0.0)]
    bare = [*rows, (0, "G05", "2W", NAN, 1e8, 0.0)]
    assert names(one(bare, SIGNALS))[1] == "2L"
    # With nothing better, the phase alone serves.
    assert names(one([rows[0], bare[2]], SIGNALS))[1] == "2W"
    # And what has neither is no measurement.
    empty = [rows[0], (0, "G05", "2W", NAN, NAN, 0.0)]
    assert names(one(empty, SIGNALS))[1] == "--"


@pytest.mark.parametrize("channel", range(-7, 7))
def test_glonass_channels(channel):
    rows = [(0, "R03", s, 2e7, 1e8, 100.0, channel) for s in ("1C", "2C")]
    row = one(rows, SIGNALS)
    expected = [1602e6 + channel * 562.5e3, 1246e6 + channel * 437.5e3]
    assert row["frequency"][:2].tolist() == expected
    assert row["phase"][:2] == pytest.approx(1e8 * C / np.array(expected), rel=1e-15)


def test_without_its_channel_a_glonass_signal_is_not_used():
    row = one([(0, "R03", "1C", 2e7, 1e8, 0.0)], SIGNALS)
    assert names(row) == ["--", "--", "--"]
    assert np.isnan(row["code"]).all()


@pytest.mark.parametrize(
    ("signals", "systems", "message"),
    [
        (["X1C"], "G", "'X1C' is no signal"),
        (["G1"], "G", "'G1' is no signal"),
        (["GC1"], "G", "'GC1' is no signal"),
        (["G1CW"], "G", "'G1CW' is no signal"),
        (["E1C", "E5Q", "E6C", "E7Q"], "E", "E has more than 3 bands"),
        (["G1C"], "GX", "no system 'X'"),
    ],
)
def test_impossible_signals_are_refused(signals, systems, message):
    with pytest.raises(ConfigurationError, match=message):
        select_signals(signals, systems)


def test_systems_that_are_not_asked_for_are_left_out():
    rows = [(0, "G05", "1C", 2e7, 1e8, 0.0), (0, "E05", "1C", 2e7, 1e8, 0.0)]
    found = gather_epochs(observations(rows), select_signals(SIGNALS, "E"))
    assert SATELLITE_NAMES[found.rows["satellite"]].tolist() == [b"E05"]
    # Four bands of a system that nobody asks for are no fault.
    select_signals(["E1C", "E5Q", "E6C", "E7Q", "G1C"], "G")


def test_satellites_without_a_number_are_counted():
    rows = [(0, s, "1C", 2e7, 1e8, 0.0) for s in ("G05", "G33", "S20", "I02", "C64", "G00")]
    found = gather_epochs(observations(rows), select_signals(["G1C", "C1X"], "GC"))
    assert found.unknown == 4
    assert SATELLITE_NAMES[found.rows["satellite"]].tolist() == [b"G05"]


GRID = [
    (t * SECOND, satellite, signal, 2e7 + 1e3 * t, 1e8, 10.0, 1)
    for t in range(3)
    for satellite in ("G05", "G17", "R03", "E11", "C08", "J02")
    for signal in ("1C", "2C", "2I", "2L", "2W", "5Q", "7Q")
]


@given(st.permutations(range(len(GRID) // 3)), st.integers(0, 2))
def test_the_order_of_an_epochs_rows_means_nothing(order, epoch):
    """Within an epoch; epochs come in the order of the log."""
    size = len(GRID) // 3
    shuffled = list(range(len(GRID)))
    shuffled[epoch * size : (epoch + 1) * size] = [epoch * size + k for k in order]
    selection = select_signals([*SIGNALS, "C2I", "C7Q", "J1C", "E7Q"], "GRECJ")
    straight = gather_epochs(observations(GRID), selection)
    mixed = gather_epochs(observations([GRID[k] for k in shuffled]), selection)
    assert len(straight.rows) == 3 * 6
    assert mixed.epochs.tobytes() == straight.epochs.tobytes()
    for name in straight.rows.dtype.names:
        np.testing.assert_array_equal(mixed.rows[name], straight.rows[name])


def sights_of(rows, log):
    """Sights of satellites at times, told apart by their clocks."""
    n = len(rows)
    names_ = [r[1] for r in rows]
    return Columns.build(
        np.array([r[0] for r in rows], dtype=np.int64),
        {
            "satellite": np.array(names_, dtype="S3"),
            "position_ecef_m": np.arange(3.0 * n).reshape(n, 3),
            "velocity_ecef_m_s": np.zeros((n, 3)),
            "clock_s": np.array([r[2] for r in rows]) / C,
            "clock_drift_s_s": np.zeros(n),
            "elevation_rad": np.ones(n),
            "azimuth_rad": np.ones(n),
            "range_std_m": np.ones(n),
            "ephemeris_age_s": np.ones(n),
            "issue": np.ones(n, dtype=np.int32),
            "health": np.zeros(n, dtype=np.int32),
        },
        log_time_ns=np.array(log, dtype=np.int64),
    )


def test_an_epoch_that_comes_late_has_its_sights():
    """In the log the epoch of 2 s stands behind that of 3 s."""
    times, log = [1, 3, 2, 4], [1, 3, 4, 5]
    rows = [(t * SECOND, s, "1C", 2e7, 1e8, 0.0) for t in times for s in ("G05", "G09")]
    logs = [t * SECOND for t in log for _ in range(2)]
    sights = sights_of([(r[0], r[1], r[0] / SECOND) for r in rows], logs)
    selection = select_signals(["G1C"], "G")
    found = gather_epochs(observations(rows, log=logs), selection, sights)
    assert found.epochs["t"].tolist() == [t * SECOND for t in times]
    assert found.rows["seen"].tolist() == [1] * 8
    assert found.rows["clock"] == pytest.approx(np.repeat(np.array(times, float), 2))


def test_an_epoch_never_crosses_a_log_time():
    """Two halves of an epoch that became known apart stay apart, whole as well as in blocks."""
    rows = [(0, "G05", "1C", 2e7, 1e8, 0.0), (0, "G09", "1C", 2e7, 1e8, 0.0)]
    selection = select_signals(["G1C"], "G")
    columns = observations(rows, log=[5, 6])
    whole = gather_epochs(columns, selection)
    assert whole.epochs["log_t"].tolist() == [5, 6]
    assert whole.epochs["count"].tolist() == [1, 1]
    for k in range(2):
        half = gather_epochs(columns.take(slice(k, k + 1)), selection)
        assert half.rows["satellite"][0] == whole.rows["satellite"][k]


def test_a_satellite_without_a_sight_is_not_seen():
    rows = [(0, s, "1C", 2e7, 1e8, 0.0) for s in ("G05", "G09", "E03", "C05")]
    sights = sights_of([(0, "G09", 1.0), (0, "C05", 2.0)], [0, 0])
    found = gather_epochs(observations(rows), select_signals(["G1C", "E1C", "C1C"], "GEC"), sights)
    by_name = dict(
        zip(SATELLITE_NAMES[found.rows["satellite"]].tolist(), found.rows["seen"], strict=True)
    )
    assert by_name == {b"G05": 0, b"G09": 1, b"E03": 0, b"C05": 1}
