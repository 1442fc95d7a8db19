"""Ephemerides as records and as rows of a channel: nothing may change on the way."""

from pathlib import Path

import numpy as np
import pytest

from replay import channels
from replay.errors import DataError
from replay.gnss.ephemerides import ephemeris_columns, ephemeris_records, satellite_names
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

GLONASS = ("position_m", "velocity_m_s", "acceleration_m_s2", "frequency_channel")
BOTH = ("toe_s", "accuracy_m", "fit_s", "af0", "af1", "af2", "group_delay_1_s", "group_delay_2_s")


def some_records(count: int) -> np.ndarray:
    """Every field of each system's own message filled with what no other one has."""
    rng = np.random.default_rng(7)
    records = np.zeros(count, dtype=EPHEMERIS_DTYPE)
    records["system"] = rng.choice([ord(letter) for letter in "GREJC"], count)
    records["prn"] = rng.integers(1, 64, count)
    for name in ("toe_ns", "toc_ns", "transmitted_ns"):
        records[name] = rng.integers(10**18, 2 * 10**18, count)
    glonass = records["system"] == ord("R")
    for name in EPHEMERIS_DTYPE.names[5:]:
        own = np.ones(count, dtype=bool)
        if name in GLONASS:
            own = glonass
        elif EPHEMERIS_DTYPE[name].kind == "f" and name not in BOTH:
            own = ~glonass
        shape = records[name].shape
        if EPHEMERIS_DTYPE[name].kind == "i":
            values = rng.integers(-(2**31), 2**31, shape)
        else:
            values = rng.normal(size=shape) * 10.0 ** rng.integers(-15, 9, shape)
        records[name][own] = values[own]
    return records


def through_a_log(columns: Columns, path: Path) -> Columns:
    with LogWriter(path) as writer:
        writer.add_channel(channels.NAV.topic, channels.NAV.message)
        writer.write({channels.NAV.topic: columns})
    with LogReader(path) as log:
        return log.read(channels.NAV.topic)


def test_a_log_gives_back_every_bit(tmp_path: Path) -> None:
    records = some_records(400)
    read = through_a_log(ephemeris_columns(records), tmp_path / "nav.mcap")
    order = np.argsort(records["transmitted_ns"], kind="stable")
    assert ephemeris_records(read).tobytes() == records[order].tobytes()
    np.testing.assert_array_equal(read.valid_time_ns, records["transmitted_ns"][order])
    np.testing.assert_array_equal(read.log_time_ns, read.valid_time_ns)
    assert satellite_names(records[order]).tolist() == read["satellite"].tolist()


def test_what_a_message_lacks_is_absent_in_the_log(tmp_path: Path) -> None:
    read = through_a_log(ephemeris_columns(some_records(50)), tmp_path / "nav.mcap")
    glonass = np.char.startswith(read["satellite"].astype(str), "R")
    assert 0 < glonass.sum() < 50
    for name in GLONASS:
        np.testing.assert_array_equal(read.is_present(name), glonass)
    np.testing.assert_array_equal(read.is_present("sqrt_a"), ~glonass)
    assert np.isnan(read["sqrt_a"][glonass]).all()


def test_a_message_of_unknown_sending_is_valid_at_its_reference_time() -> None:
    records = some_records(2)
    records["transmitted_ns"] = 0
    records["toe_ns"] = 5, 3
    columns = ephemeris_columns(records)
    assert columns.valid_time_ns.tolist() == [3, 5]
    assert columns["transmitted_ns"].tolist() == [0, 0]
    later = ephemeris_columns(records, log_time_ns=9)
    assert later.log_time_ns.tolist() == [9, 9] and later.valid_time_ns.tolist() == [3, 5]
    apart = ephemeris_columns(records, log_time_ns=[6, 7])
    assert apart.log_time_ns.tolist() == [6, 7] and apart.valid_time_ns.tolist() == [5, 3]


@pytest.mark.parametrize("name", [b"G5", b"GPS", b"G 5"])
def test_a_satellite_without_a_number_is_told(name: bytes) -> None:
    columns = ephemeris_columns(some_records(1))
    columns.values["satellite"] = np.array([name], dtype="S3")  # type: ignore[index]
    with pytest.raises(DataError, match="a letter and two digits"):
        ephemeris_records(columns)
