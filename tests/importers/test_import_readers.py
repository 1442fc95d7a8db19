"""Readers: CSV fast and slow, RTKLIB solutions and time tags, gzip or plain."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

import numpy as np
import pytest
import small_recording
from hypothesis import given
from hypothesis import strategies as st

from replay.errors import ForeignFileError
from replay.importers.delimited import read_csv
from replay.importers.files import File, read_file
from replay.importers.findings import Findings
from replay.importers.rtklib_pos import read_pos
from replay.importers.rtklib_tag import read_tag


def file(text: str | bytes, name: str = "x.csv") -> File:
    return File(name, text if isinstance(text, bytes) else text.encode(), "", 0)


def csv(text: str, columns: tuple[str, ...] = (), texts: frozenset[str] = frozenset()) -> tuple:
    findings = Findings()
    return read_csv(file(text), columns, texts, findings), findings


def test_header_or_given_names() -> None:
    read, _ = csv("t, a\n1,2\n3,4\n")
    assert read.number("a").tolist() == [2.0, 4.0]
    assert read.lines.tolist() == [2, 3]
    read, _ = csv("1,2\n3,4", ("t", "a"))
    assert read.number("t").tolist() == [1.0, 3.0]
    assert read.lines.tolist() == [1, 2]


def test_a_missing_header_is_told() -> None:
    with pytest.raises(ForeignFileError, match="first line names no columns"):
        csv("1,2\n3,4\n")


def test_a_byte_order_mark_is_no_part_of_a_name_and_names_differ() -> None:
    read, _ = csv("\ufefft,a\r\n1,2\r\n")
    assert read.number("t").tolist() == [1.0]
    with pytest.raises(ForeignFileError, match="two columns are named 'a'"):
        csv("a,b,a\n1,2,3\n")


def test_an_empty_file_is_told() -> None:
    with pytest.raises(ForeignFileError, match="no row that can be read"):
        csv("a,b\n")


def test_empty_fields_are_nan() -> None:
    read, findings = csv("a,b\n1,\n,2\nnan,3\n")
    np.testing.assert_array_equal(read.number("a"), [1.0, np.nan, np.nan])
    assert not findings.losses


def test_damaged_lines_are_counted_with_their_numbers() -> None:
    read, findings = csv("a,b\n1,2\n3\n\n5,x\r\n# remark\n7,8\n9,10,11\n")
    assert read.number("a").tolist() == [1.0, 7.0]
    assert read.lines.tolist() == [2, 7]
    told = [str(loss) for loss in findings.losses.losses]
    assert told == [
        "a line has not the 2 fields that are expected; skipped: 2 rows (x.csv, lines 3, 8)",
        "a field of column b is no number; skipped: 1 rows (x.csv, line 5)",
    ]


def test_strict_names_the_first_damaged_line() -> None:
    with pytest.raises(ForeignFileError, match="no number") as error:
        read_csv(file("a,b\n1,2\n3,four\n"), (), frozenset(), Findings(strict=True))
    assert error.value.where == "x.csv:3"
    assert "fields are a, b" in error.value.mend


@given(
    st.lists(
        st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=2),
        min_size=1,
        max_size=20,
    )
)
def test_fast_and_slow_reading_give_the_same_bits(rows: list[list[float]]) -> None:
    clean = "".join(f"{a!r},{b!r}\n" for a, b in rows)
    fast, _ = csv(clean, ("a", "b"))
    slow, findings = csv(clean + "# a comment makes it slow\n", ("a", "b"))
    assert not findings.losses
    for name in ("a", "b"):
        assert fast.number(name).tobytes() == slow.number(name).tobytes()


def test_text_columns_stay_text() -> None:
    read, _ = csv("t,a\n1752003261.123456789,2\n", (), frozenset({"t"}))
    assert read.text("t") == ["1752003261.123456789"]


def test_gzip_is_told_by_its_first_bytes(tmp_path: Path) -> None:
    path = tmp_path / "plain.name"
    path.write_bytes(gzip.compress(b"a,b\n1,2\n"))
    read = read_file(path, Findings(), mend="")
    assert read.data == b"a,b\n1,2\n"
    assert read.size == path.stat().st_size


def test_a_cut_gzip_file_keeps_its_whole_lines(tmp_path: Path) -> None:
    text = "".join(f"{i},{i * i}\n" for i in range(20_000)).encode()
    path = tmp_path / "cut.csv.gz"
    path.write_bytes(gzip.compress(text)[:-3000])
    findings = Findings()
    read = read_file(path, findings, mend="")
    assert text.startswith(read.data) and read.data.endswith(b"\n") and len(read.data) > 50_000
    assert findings.losses.losses[0].count == len(read.data)
    assert "the gzip file is damaged" in findings.losses.losses[0].what
    with pytest.raises(ForeignFileError, match="the gzip file is damaged"):
        read_file(path, Findings(strict=True), mend="")


def test_a_wrong_checksum_keeps_the_lines_but_is_told(tmp_path: Path) -> None:
    packed = bytearray(gzip.compress(b"1,2\n3,4\n"))
    packed[-6] ^= 1
    path = tmp_path / "flipped.csv.gz"
    path.write_bytes(bytes(packed))
    findings = Findings()
    assert read_file(path, findings, mend="").data == b"1,2\n3,4\n"
    assert findings.losses


@pytest.mark.parametrize("stored", [b"\n", b"\r\n"])
@pytest.mark.parametrize("last", [True, False])
def test_recorded_ends_do_not_depend_on_the_stored_line_ends(stored: bytes, last: bool) -> None:
    data = stored.join([b"abc", b"", b"de"]) + (stored if last else b"")
    assert file(data).recorded_ends(2).tolist() == [5, 7, 11]
    assert file(data).recorded_ends(1).tolist() == [4, 5, 8]


def test_pos_columns_follow_the_header() -> None:
    text = "% program : x\n" + "\n".join([small_recording.HEADER, *small_recording.pos_lines()])
    read = read_pos(file(text), Findings())
    assert read.time_scale == "GPST"
    assert read.text("time")[0] == "2025/07/08 19:34:21.250"
    assert read.number("sdun").tolist() == [-0.006] * 7
    assert read.number("sdvun").tolist() == [0.003] * 7
    assert read.lines[0] == 3


def test_pos_of_week_and_seconds_in_ecef() -> None:
    text = (
        "%  GPST          x-ecef(m)      y-ecef(m)      z-ecef(m)   Q  ns\n"
        "2374 243261.250  -1277354.1  -4717325.2  4086123.3   1  12\n"
    )
    read = read_pos(file(text), Findings())
    assert (read.number("week")[0], read.number("tow")[0]) == (2374.0, 243261.25)
    assert read.number("x-ecef")[0] == -1277354.1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2025/07/08 19:34:21 1 2 3\n", "no header line names the columns"),
        ("% JST latitude(deg) longitude(deg)\n", "time scale is 'JST'"),
        ("% GPST latitude(d'\") longitude(d'\")\n1 2 3 4\n", "not in decimal degrees"),
        (small_recording.HEADER + "\n", "no row that can be read"),
    ],
)
def test_a_pos_file_that_cannot_be_read(text: str, message: str) -> None:
    with pytest.raises(ForeignFileError, match=message):
        read_pos(file(text), Findings())


def test_a_cut_pos_line_is_counted() -> None:
    lines = [small_recording.HEADER, *small_recording.pos_lines()]
    lines[3] = lines[3][:40]
    findings = Findings()
    assert len(read_pos(file("\n".join(lines)), findings)) == 6
    assert findings.losses.losses[0].where == "x.csv, line 4"


def test_tag() -> None:
    lines = ["abcd", "ef"]
    head = b"TIMETAG RTKLIB 2.4.3".ljust(60, b"\0") + struct.pack(
        "<IId", 99, small_recording.START_S, 0.5
    )
    tag = read_tag(file(head + struct.pack("<4I", 10, 6, 30, 10)), Findings())
    assert tag.start_ns == (small_recording.START_S - 315_964_800) * 10**9 + 5 * 10**8
    assert tag.elapsed_ms.tolist() == [10, 30]
    assert tag.position.tolist() == file("\n".join(lines)).recorded_ends(2).tolist()


def test_a_cut_tag_is_counted_and_a_foreign_one_refused() -> None:
    whole = small_recording.tag_bytes(small_recording.imu_lines())
    findings = Findings()
    assert len(read_tag(file(whole[:-3]), findings).position) == 199
    assert findings.losses.losses[0].count == 5
    with pytest.raises(ForeignFileError, match="no RTKLIB time-tag file"):
        read_tag(file(b"UBX" + whole), Findings())
    with pytest.raises(ForeignFileError, match="fewer than two time tags"):
        read_tag(file(whole[:84]), Findings())
