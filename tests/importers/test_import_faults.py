"""Each fault of a recording or of a spec, and what is said about it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import small_recording

from replay.errors import ConfigurationError, ExitCode, ForeignFileError, UsageError
from replay.importers import ImportResult, import_log, load_spec, update_expected
from replay.log.reader import LogReader


@dataclasses.dataclass
class Case:
    """A small recording that a test damages."""

    folder: Path
    spec: Path

    def edit_spec(self, old: str, new: str) -> None:
        text = self.spec.read_text()
        assert old in text
        self.spec.write_text(text.replace(old, new, 1))

    def edit_imu(self, change: Callable[[list[str]], object]) -> None:
        path = self.folder / "imu.csv"
        lines = path.read_text().splitlines()
        change(lines)
        path.write_text("\n".join(lines) + "\n")

    def run(self, *, strict: bool = False) -> ImportResult:
        return import_log(self.spec, self.folder, self.folder / "out.mcap", strict=strict)


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return Case(tmp_path, small_recording.write(tmp_path))


def set_line(number: int, text: str) -> Callable[[list[str]], object]:
    return lambda lines: lines.__setitem__(number - 1, text)


def test_a_missing_file_names_its_path_and_origin(case: Case) -> None:
    (case.folder / "fix.pos.gz").unlink()
    with pytest.raises(ForeignFileError, match="cannot be read") as error:
        case.run()
    assert error.value.where == str(case.folder / "fix.pos.gz")
    assert "https://example.org/small" in error.value.mend
    assert not (case.folder / "out.mcap").exists()


def test_a_missing_tag(case: Case) -> None:
    (case.folder / "imu.csv.tag").unlink()
    with pytest.raises(ForeignFileError, match="cannot be read"):
        case.run()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0.1,0.2,1.0,0.5,-1.0", "has not the 7 fields"),
        ("0.1,0.2,oops,0.5,-1.0,90.0,1040", "column az is no number"),
        ("0.1,0.2,nan,0.5,-1.0,90.0,1040", "specific_force_body_m_s2 is empty or not finite"),
        ("0.1,0.2,inf,0.5,-1.0,90.0,1040", "specific_force_body_m_s2 is empty or not finite"),
        ("0.1,0.2,1.0,,-1.0,90.0,1040", "angular_rate_body_rad_s is empty or not finite"),
        ("0.1,0.2,1.0,0.5,-1.0,90.0,", "the time is empty or no time"),
    ],
)
def test_a_damaged_line_is_skipped_and_counted(case: Case, line: str, message: str) -> None:
    case.edit_imu(set_line(6, line))
    result = case.run()
    assert result.exit_code is ExitCode.LOSS
    assert result.rows["/imu/raw"] == 199
    (loss,) = result.losses.losses
    assert message in loss.what and loss.where.endswith("imu.csv, line 6") and loss.count == 1
    with LogReader(case.folder / "out.mcap") as log:
        assert any(message in note for note in [log.metadata["replay.manifest"]["json"]])
    with pytest.raises(ForeignFileError) as error:
        case.run(strict=True)
    assert error.value.where == f"{case.folder / 'imu.csv'}:6"


def test_time_that_goes_backward_is_put_in_order(case: Case) -> None:
    def swap(lines: list[str]) -> None:
        lines[9], lines[10] = lines[10], lines[9]

    case.edit_imu(swap)
    result = case.run()
    (loss,) = result.losses.losses
    assert "/imu/raw: time goes backward, by up to 0.00999999 s" in loss.what
    assert loss.where.endswith("line 11") and result.exit_code is ExitCode.LOSS
    with LogReader(case.folder / "out.mcap") as log:
        rows = log.read("/imu/raw")
    assert len(rows) == 200
    assert (np.diff(rows.valid_time_ns) > 0).all()
    rate = np.degrees(rows["angular_rate_body_rad_s"][:, 0])
    np.testing.assert_allclose(rate, 0.5 * np.arange(200), atol=1e-12)


def test_a_repeated_time_keeps_both_rows(case: Case) -> None:
    case.edit_imu(set_line(8, "0.1,0.2,1.0,0.5,-1.0,90.0,1048"))
    result = case.run()
    assert result.rows["/imu/raw"] == 200 and result.exit_code is ExitCode.LOSS
    (loss,) = result.losses.losses
    assert "a time occurs twice" in loss.what and loss.where.endswith("line 8")


def test_a_quality_that_the_spec_does_not_name(case: Case) -> None:
    case.edit_spec(', 2 = "RTK_FLOAT"', "")
    result = case.run()
    (loss,) = result.losses.losses
    assert "Q holds a code that the spec does not name" in loss.what and loss.count == 4
    with LogReader(case.folder / "out.mcap") as log:
        assert log.read("/gnss/rover/fix")["quality"].tolist() == [0, 6, 0, 6, 0, 6, 0]


def test_a_column_that_the_file_lacks(case: Case) -> None:
    case.edit_spec('["gx", "gy", "gz"]', '["gx", "gy", "gzz"]')
    with pytest.raises(ForeignFileError, match="no column 'gzz'") as error:
        case.run()
    assert "did you mean gz?" in error.value.mend


@pytest.mark.parametrize(
    ("old", "new", "message", "where", "mend"),
    [
        ("licence =", "license =", "unknown key license", "small.toml", "did you mean licence?"),
        ("[channels.fix.time]", "[chanels.fix.time]", "unknown key chanels", "", "channels"),
        ("mounting =", "mountings =", "unknown key mountings", "[channels.imu]", "mounting?"),
        ('scale = "ticks"', 'scales = "ticks"', "unknown key time.scales", "", "time.scale?"),
        ("satellite_count", "satelite_count", "satelite_count", "[channels.fix]", "fields.satell"),
        ('unit = "deg/s"', 'unit = "m/s"', "unit 'm/s' is none of rad/s", "", "deg/s"),
        ('"-0.1 s"', '"-0.1 m"', "time.offset: '-0.1 m' is no quantity in s", "imu", "ms"),
        ('"ticks"', '"tocks"', "tocks", "[channels.imu]", "format"),
        ('source = "imu"', 'source = "umi"', "no source 'umi'", "[channels.imu]", "imu, rtk"),
        ('["10 cm", -0.05, -0.65]', "[0.1, 0.2]", "lever_arm has 2 numbers", "fix", "three"),
        ("satellite_count =", "temperature_c =", "has no field temperature_c", "fix", "position"),
        ("axes forward-left-up", "axis up", "mounting step 'axis up' is unknown", "", "axes"),
        ('kind = "gnss_fix"', 'kind = "imu"', "are both /imu/raw", "", ""),
        ('title = "small"', "title = ", "no TOML", "small.toml", ""),
        ('title = "small"', "", "missing required field `title`", "small.toml", "format"),
    ],
)
def test_a_spec_that_is_off(
    case: Case, old: str, new: str, message: str, where: str, mend: str
) -> None:
    case.edit_spec(old, new)
    if message.startswith("are both"):
        text = case.spec.read_text()
        case.spec.write_text(text[: text.index("[channels.fix.fields]")])
    with pytest.raises(UsageError) as error:
        case.run()
    assert message in error.value.what
    assert where in error.value.where
    assert mend in error.value.mend


def test_an_expected_digest_of_no_channel_and_fallbacks_in_a_circle(case: Case) -> None:
    case.spec.write_text(case.spec.read_text() + '\n[expect]\nimus = "00"\n')
    with pytest.raises(ConfigurationError, match="expects a digest of 'imus'") as error:
        case.run()
    assert "imu, fix" in error.value.mend
    case.edit_spec('source = "imu"\n', 'source = "imu"\nfallback = "imu"\n')
    with pytest.raises(ConfigurationError, match="leads back to itself"):
        case.run()


def test_a_missing_spec(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        load_spec(tmp_path / "none.toml")


def test_a_position_is_needed_once(case: Case) -> None:
    case.edit_spec(
        "[channels.fix.fields]\n",
        '[channels.fix.fields]\nposition_ecef_m = { columns = ["x", "y", "z"], unit = "m" }\n',
    )
    with pytest.raises(ConfigurationError, match="either as position_geodetic or"):
        case.run()


def test_a_fix_needs_an_uncertainty(case: Case) -> None:
    text = case.spec.read_text().splitlines(keepends=True)
    kept = [line for line in text if not line.startswith("position_covariance")]
    case.spec.write_text("".join(kept))
    with pytest.raises(ConfigurationError, match="a fix needs an uncertainty"):
        case.run()


def test_a_recording_without_a_usable_row(case: Case) -> None:
    case.edit_imu(lambda lines: lines.__setitem__(slice(None), [f"{s},,,,,,1" for s in lines]))
    with pytest.raises(ForeignFileError, match="no row that can be read"):
        case.run()


def test_digests_are_compared_with_those_expected_and_can_be_updated(case: Case) -> None:
    result = case.run()
    assert result.exit_code is ExitCode.OK and result.mismatches == ()
    before = case.spec.read_text()
    update_expected(case.spec, result)
    assert case.spec.read_text().startswith(before.rstrip())
    again = case.run()
    assert again.mismatches == () and again.digests == result.digests
    case.edit_spec('"-0.1 s"', '"-0.2 s"')
    changed = case.run()
    assert changed.exit_code is ExitCode.FAILURE
    (told,) = changed.mismatches
    assert told.startswith("imu (/imu/raw): digest ") and "the spec expects" in told
    update_expected(case.spec, changed)
    assert case.spec.read_text().count("[expect]") == 1
    assert case.run().exit_code is ExitCode.OK


FALLBACK = """
[sources.slow]
file = "slow.csv"
[channels.slow]
kind = "imu"
source = "slow"
loss = "rebuilt from something slower"
skip_when_zero = ["wx", "wy", "wz"]
gravity_from_attitude = { columns = ["roll", "pitch"], unit = "deg", gravity = 9.8 }
[channels.slow.time]
columns = ["t"]
scale = "relative"
epoch = "2025-07-08T19:34:21"
[channels.slow.fields]
angular_rate_body_rad_s = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force_body_m_s2 = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
"""


def test_a_fallback_stands_in_and_is_told(case: Case) -> None:
    case.edit_spec('source = "imu"\n', 'source = "imu"\nfallback = "slow"\n')
    case.spec.write_text(case.spec.read_text() + FALLBACK)
    (case.folder / "slow.csv").write_text(
        "t,wx,wy,wz,ax,ay,az,roll,pitch\n"
        "0.0,0,0,0,0,0,0,0,0\n"
        "0.1,0.01,0,0,1,2,3,0,30\n"
        "0.2,0,0.01,0,1,2,3,-90,0\n"
    )
    whole = case.run()
    assert whole.topics == {"imu": "/imu/raw", "fix": "/gnss/rover/fix"}
    assert whole.exit_code is ExitCode.OK
    (case.folder / "imu.csv").unlink()
    result = case.run()
    assert result.topics == {"slow": "/imu/raw", "fix": "/gnss/rover/fix"}
    told = [loss.what for loss in result.losses.losses]
    assert told == [
        "the file is missing, so channel slow stands in for imu",
        "/imu/raw: wx, wy, wz are all zero, which means no measurement; row skipped",
        "rebuilt from something slower",
    ]
    assert result.exit_code is ExitCode.LOSS
    with LogReader(case.folder / "out.mcap") as log:
        force = log.read("/imu/raw")["specific_force_body_m_s2"]
    up = 9.8 * np.sqrt(3) / 2
    np.testing.assert_allclose(force, [[1 + 4.9, 2, 3 - up], [1, 2 + 9.8, 3]], atol=1e-14)
    with pytest.raises(ForeignFileError, match="stands in for imu"):
        case.run(strict=True)
