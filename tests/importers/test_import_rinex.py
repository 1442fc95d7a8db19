"""RINEX streams: small files by hand, real ones by independent counts."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
import small_rinex
from small_rinex import EPOCHS, FIRST, HEADER, epoch, record, times

from replay import time
from replay.errors import ConfigurationError, ExitCode, ForeignFileError
from replay.gnss.ephemerides import ephemeris_records
from replay.importers import ImportResult, import_log, load_spec, update_expected
from replay.importers.files import read_file
from replay.importers.findings import Findings
from replay.importers.rinex_nav import read_rinex_nav
from replay.log.columns import Columns
from replay.log.reader import LogReader

SPECS = Path(__file__).resolve().parents[2] / "recordings" / "specs"
OBS, EPOCH, RECEIVER = (f"/gnss/rover/{name}" for name in ("obs", "epochs", "receiver"))
NAV, IONOSPHERE, TIME = "/gnss/nav", "/gnss/nav/ionosphere", "/gnss/nav/time"
WEEK_START = time.from_week(2114, 0.0)


class Case:
    """Small files that a test changes, and what their import gives."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.spec = small_rinex.write(folder)

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.folder / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))

    def append(self, text: str) -> None:
        self.spec.write_text(self.spec.read_text() + text)

    def run(self, *, strict: bool = False) -> ImportResult:
        return import_log(self.spec, self.folder, self.folder / "out.mcap", strict=strict)

    def read(self, topic: str) -> Columns:
        with LogReader(self.folder / "out.mcap") as log:
            return log.read(topic)


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return Case(tmp_path)


def told(result: ImportResult) -> list[tuple[str, str, int]]:
    return [(loss.what, Path(loss.where).name, loss.count) for loss in result.losses.losses]


def test_observations_epochs_and_receiver(case: Case) -> None:
    result = case.run(strict=True)
    assert result.exit_code is ExitCode.OK
    assert result.rows == {RECEIVER: 1, EPOCH: 3, OBS: 6, NAV: 3, IONOSPHERE: 2, TIME: 1}
    assert {name.partition(" ")[0] for name in result.topics} == {"rover", "nav"}

    obs = case.read(OBS)
    np.testing.assert_array_equal(obs.valid_time_ns, np.repeat(times(*EPOCHS), 2))
    np.testing.assert_array_equal(obs.log_time_ns, obs.valid_time_ns)
    assert obs["satellite"].tolist() == [b"E11", b"G05"] * 3
    assert obs["signal"].tolist() == [b"1X", b"1C"] * 3
    seconds = np.repeat(EPOCHS, 2)
    np.testing.assert_array_equal(obs["pseudorange_m"], np.tile([23e6, 20e6], 3) + seconds)
    assert obs.is_present("carrier_phase_cycles").tolist() == [False, True] * 3
    np.testing.assert_array_equal(obs["carrier_phase_cycles"][1::2], 110e6 + np.array(EPOCHS))

    epochs = case.read(EPOCH)
    np.testing.assert_array_equal(epochs.valid_time_ns, times(*EPOCHS))
    assert epochs["flag"].tolist() == [0, 0, 0] and epochs["satellite_count"].tolist() == [2, 2, 2]
    np.testing.assert_allclose(epochs["clock_offset_s"], 1e-6 * np.array(EPOCHS), rtol=1e-12)

    receiver = case.read(RECEIVER)
    assert receiver.valid_time_ns.tolist() == [FIRST]
    for name, text in (
        ("marker", "MARK"),
        ("receiver", "TRIMBLE NETR9"),
        ("antenna", "TRM57971.00     NONE"),
    ):
        assert receiver.ragged(name).texts() == [text]
    assert receiver["approximate_position_ecef_m"].tolist() == [list(small_rinex.POSITION)]
    assert receiver["antenna_offset_enu_m"].tolist() == [[0.25, -0.125, 1.5]]
    assert receiver["interval_s"].tolist() == [1.0]
    assert receiver.ragged("header").blobs() == [HEADER.encode()]


def test_navigation_of_two_files_is_known_from_the_start(case: Case) -> None:
    result = case.run(strict=True)
    assert any("/gnss/nav: 1 of 4 rows repeat another exactly" in note for note in result.notes)
    nav = case.read(NAV)
    assert nav.log_time_ns.tolist() == [FIRST] * 3
    sent = [5400.0, 5430.0, 6000.0]
    np.testing.assert_array_equal(nav.valid_time_ns, WEEK_START + np.array(sent) * 10**9)
    assert nav["satellite"].tolist() == [b"G07", b"G05", b"G09"]
    records = ephemeris_records(nav)
    assert records["prn"].tolist() == [7, 5, 9] and records["toe_s"].tolist() == [7200.0] * 3
    assert records["crs"].tolist() == [1.5] * 3 and records["i_dot"].tolist() == [16.5] * 3

    ionosphere = case.read(IONOSPHERE)
    assert ionosphere.log_time_ns.tolist() == [FIRST] * 2
    rows = dict(
        zip(
            ionosphere.ragged("system").texts(),
            [ionosphere.ragged("coefficients").row(k).tolist() for k in range(2)],
            strict=True,
        )
    )
    assert rows == {
        "G": [1e-8, 2e-8, 3e-8, 4e-8, 8e4, 1.6e4, -1e5, -6e4],
        "E": [41.0, 0.05, 0.0125, 0.0],
    }
    assert sorted(ionosphere["model"].tolist()) == [1, 3]
    scales = case.read(TIME)
    assert scales.ragged("scales").texts() == ["GAUT"] and scales["week"].tolist() == [2114]
    assert (scales["a0_s"][0], scales["a1"][0]) == (1.8626451492e-09, -8.881784197e-16)
    assert scales["reference_s"].tolist() == [259200.0]


def test_navigation_as_it_was_transmitted(case: Case) -> None:
    case.edit("small.toml", "[streams.nav]", '[streams.nav]\navailable = "transmitted"')
    case.run(strict=True)
    nav = case.read(NAV)
    np.testing.assert_array_equal(nav.log_time_ns, nav.valid_time_ns)
    # The message of 6000 s comes after the epochs: nothing before it may know it.
    known = nav.log_time_ns <= case.read(OBS).log_time_ns[-1]
    assert nav["satellite"][known].tolist() == [b"G07", b"G05"]
    assert case.read(IONOSPHERE).log_time_ns.tolist() == [WEEK_START + 5400 * time.NS_PER_S] * 2


def test_a_log_of_navigation_alone_starts_with_its_first_message(case: Case) -> None:
    case.edit("small.toml", '[streams.rover]\nsource = "obs"\n', "")
    case.run()
    assert case.read(NAV).log_time_ns.tolist() == [WEEK_START + 5400 * time.NS_PER_S] * 3


def test_a_stream_can_be_moved_in_time(case: Case) -> None:
    case.edit("small.toml", 'source = "obs"', 'source = "obs"\ntime_offset = "-20 ms"')
    result = case.run()
    for topic in (OBS, EPOCH, RECEIVER):
        columns = case.read(topic)
        assert columns.valid_time_ns[0] == columns.log_time_ns[0] == FIRST - 20_000_000
    assert case.read(NAV).log_time_ns[0] == FIRST - 20_000_000
    assert any("-0.02 s were added" in note for note in result.notes)


def test_a_better_position_stands_in_and_is_noted(case: Case) -> None:
    stream = 'source = "obs"\nreceiver = "base"\nposition_ecef_m = [1.0, "2 km", 3.0]'
    case.edit("small.toml", 'source = "obs"', stream)
    result = case.run()
    receiver = case.read("/gnss/base/receiver")
    assert receiver["approximate_position_ecef_m"].tolist() == [[1.0, 2000.0, 3.0]]
    (note,) = [note for note in result.notes if "position" in note]
    assert "(1.0, 2000.0, 3.0) m of the spec" in note and "-2430649.9956" in note


def test_events_and_later_headers_are_kept_at_their_time(case: Case) -> None:
    moved = record(f"{0.5:14.4f}{0.0:14.4f}{0.0:14.4f}", "ANTENNA: DELTA H/E/N")
    events = (
        f"> 2020  7 12  1 36 25.4940000  3  2\n{record('NEXT', 'MARKER NAME')}{moved}"
        f">                              4  1\n{record('HELLO', 'COMMENT')}"
    )
    case.edit("rover.obs", epoch(26), events + epoch(26, flag=1))
    assert case.run(strict=True).exit_code is ExitCode.OK
    receiver = case.read(RECEIVER)
    # The event without a time stands at the last epoch before it.
    np.testing.assert_array_equal(receiver.valid_time_ns, times(23, 24, 24.5))
    assert receiver.ragged("marker").texts() == ["MARK", "NEXT", "NEXT"]
    assert receiver["antenna_offset_enu_m"][:, 2].tolist() == [1.5, 0.5, 0.5]
    assert receiver.ragged("header").texts()[1].rstrip() == record("HELLO", "COMMENT").rstrip()
    epochs = case.read(EPOCH)
    np.testing.assert_array_equal(epochs.valid_time_ns, times(23, 24, 24, 24.5, 26))
    assert epochs["flag"].tolist() == [0, 0, 4, 3, 1]
    assert epochs["satellite_count"].tolist() == [2, 2, 0, 0, 2]


def test_a_file_that_is_cut_keeps_its_whole_epochs(case: Case) -> None:
    path = case.folder / "rover.obs"
    path.write_bytes(path.read_bytes()[:-20])
    result = case.run()
    assert result.exit_code is ExitCode.LOSS and result.rows[EPOCH] == 2
    ((what, where, count),) = told(result)
    line = HEADER.count("\n") + 7
    assert what == "the file ends inside an epoch; 2 whole epochs are kept"
    assert where == f"rover.obs, line {line}" and count == 1
    np.testing.assert_array_equal(case.read(EPOCH).valid_time_ns, times(23, 24))
    with pytest.raises(ForeignFileError, match="ends inside an epoch"):
        case.run(strict=True)


def test_a_damaged_epoch_and_message_are_counted(case: Case) -> None:
    case.edit("rover.obs", "> 2020  7 12  1 36 24", "> 2020  7 12  1 36 x4")
    case.edit("two.nav", "1.500000000000E+00", "1.50x000000000E+00")
    result = case.run()
    assert result.exit_code is ExitCode.LOSS
    assert result.rows[EPOCH] == 2 and result.rows[NAV] == 3
    line = HEADER.count("\n") + 4
    assert (
        "the epoch line cannot be read; epoch skipped",
        f"rover.obs, line {line}",
        1,
    ) in told(result)
    assert ("a navigation record is damaged; skipped", "two.nav, line 7", 1) in told(result)


def test_a_packed_file_that_is_damaged_gives_what_is_before(case: Case) -> None:
    path = case.folder / "rover.obs"
    rows = "".join(epoch(second) for second in range(59))
    packed = gzip.compress((HEADER + rows).encode())
    path.write_bytes(packed[: len(packed) // 2])
    result = case.run()
    assert result.exit_code is ExitCode.LOSS
    assert 0 < result.rows[EPOCH] < 59
    assert "the gzip file is damaged" in told(result)[0][0]


def test_time_that_goes_backward_is_put_in_order(case: Case) -> None:
    case.edit("rover.obs", epoch(23) + epoch(24), epoch(24) + epoch(23))
    result = case.run()
    np.testing.assert_array_equal(case.read(EPOCH).valid_time_ns, times(*EPOCHS))
    ((what, where, count),) = told(result)
    assert "time goes backward" in what and count == 1
    assert where == f"rover.obs, line {HEADER.count(chr(10)) + 4}"


def test_half_of_an_ionosphere_is_a_loss(case: Case) -> None:
    for name in ("one.nav", "two.nav"):
        case.edit(name, "GPSB", "XXXB")
    result = case.run()
    assert result.exit_code is ExitCode.LOSS and result.rows[IONOSPHERE] == 1
    assert {loss.count for loss in result.losses.losses} == {4}
    assert [what.split()[2] for what, _, _ in told(result)] == ["GPSA", "XXXB"] * 2


def test_files_that_overlap_are_joined(case: Case) -> None:
    case.edit("small.toml", "[streams.rover]\nsource = \"obs\"",
              "[sources.obs2]\nfile = \"rover2.obs\"\nformat = \"rinex-obs\"\n"
              "[streams.rover]\nsource = [\"obs2\", \"obs\"]")  # fmt: skip
    (case.folder / "rover2.obs").write_text(HEADER + epoch(26) + epoch(27))
    result = case.run(strict=True)
    np.testing.assert_array_equal(case.read(EPOCH).valid_time_ns, times(23, 24, 26, 27))
    obs = case.read(OBS)
    np.testing.assert_array_equal(obs.valid_time_ns, np.repeat(times(23, 24, 26, 27), 2))
    assert obs.sequence.tolist() == list(range(8))
    assert any(f"{OBS}: 2 of 10 rows repeat" in note for note in result.notes)
    np.testing.assert_array_equal(case.read(RECEIVER).valid_time_ns, times(23, 26))


def test_digests_of_streams_are_compared_and_can_be_updated(case: Case) -> None:
    update_expected(case.spec, case.run())
    assert '"rover /gnss/rover/obs" = "' in case.spec.read_text()
    assert len(load_spec(case.spec).expect) == 6
    assert case.run().exit_code is ExitCode.OK
    case.edit("rover.obs", f"{20e6 + 24:14.3f}", f"{20e6 + 25:14.3f}")
    changed = case.run()
    assert changed.exit_code is ExitCode.FAILURE
    (mismatch,) = changed.mismatches
    assert mismatch.startswith("rover /gnss/rover/obs (/gnss/rover/obs): digest ")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('format = "rinex-obs"', 'format = "rinex"', "source obs is of format 'rinex'"),
        ('format = "rinex-obs"', 'format = "csv"', "source obs is of format 'csv'"),
        ('source = "obs"', 'source = "nothing"', "no source 'nothing'"),
        ('source = "obs"', "source = []", "the stream has no source"),
        ('source = "obs"', 'source = "obs"\nposition_ecef_m = [1, 2]', "has 2 numbers"),
        ('source = "obs"', 'source = "obs"\navailable = "never"', "available"),
        ('source = "obs"', 'source = "obs"\nreciever = "x"', "reciever"),
        ("[streams.rover]", '[streams."a b"]', "cannot be called 'a b'"),
        (
            "[streams.nav]",
            '[streams.again]\nsource = "obs"\n[streams.nav]',
            "streams rover and again are both /gnss/rover/receiver",
        ),
        ("[streams.nav]", '[expect]\n"base /x" = "1"\n[streams.nav]', "digest of 'base /x'"),
    ],
)
def test_a_spec_that_cannot_be_is_told(case: Case, old: str, new: str, message: str) -> None:
    case.edit("small.toml", old, new)
    with pytest.raises(ConfigurationError, match=message):
        case.run()


def test_a_channel_cannot_read_a_stream(case: Case) -> None:
    case.append(
        '[channels.imu]\nkind = "imu"\nsource = "obs"\n'
        '[channels.imu.time]\ncolumns = ["t"]\nscale = "relative"\n'
    )
    with pytest.raises(ConfigurationError, match="source obs is of format 'rinex-obs'"):
        case.run()


def test_a_file_without_rows_is_no_stream(case: Case) -> None:
    for name in ("one.nav", "two.nav"):
        (case.folder / name).write_text(
            record(f"{'3.04':>9}{'':11}{'N':<20}M", "RINEX VERSION / TYPE")
            + record("", "END OF HEADER")
        )
    with pytest.raises(ForeignFileError, match="the file gives no rows"):
        case.run()


def lines_after_header(path: Path) -> list[str]:
    with gzip.open(path, "rt") as stream:
        text = stream.read()
    return text[text.index("END OF HEADER") :].splitlines()[1:]


def real(name: str, data: Path, out: Path) -> tuple[Path, ImportResult]:
    spec = SPECS / f"{name}.toml"
    return data / name, import_log(spec, data / name, out)


def test_riverside_has_every_row_of_its_files(shared_data: Path, tmp_path: Path) -> None:
    out = tmp_path / "riverside.mcap"
    folder, result = real("riverside-drive-2020-193", shared_data, out)
    assert result.exit_code is ExitCode.OK and result.mismatches == ()
    for receiver in ("rover", "base"):
        lines = lines_after_header(folder / f"{receiver}.obs.gz")
        heads = [line for line in lines if line.startswith(">")]
        # Every system has one signal, so a satellite's line that is not blank is a row.
        assert result.rows[f"/gnss/{receiver}/epochs"] == len(heads)
        assert result.rows[f"/gnss/{receiver}/obs"] == sum(
            bool(line[3:].strip()) for line in lines if not line.startswith(">")
        )
    with LogReader(out) as log:
        nav, truth = log.read(NAV), log.read("/truth")
        obs, base = log.read(OBS), log.read("/gnss/base/receiver")
        first = min(log.read(topic).log_time_ns[0] for topic in (OBS, "/gnss/base/obs", "/truth"))
    assert set(nav.log_time_ns.tolist()) == {first}
    assert base["approximate_position_ecef_m"][0, 0] == -2430697.699
    # The truth's second row: 5785 s of the week that began on 12 July 2020.
    assert truth.valid_time_ns[1] == time.parse_calendar("2020-07-12T01:36:25")
    assert truth["position_ecef_m"][1].tolist() == [-2430551.065, -4703758.457, 3544972.807]
    last = [line for line in lines_after_header(folder / "rover.obs.gz")][-1]
    row = np.flatnonzero(obs["satellite"] == last[:3].replace(" ", "0").encode())[-1]
    assert obs["pseudorange_m"][row] == float(last[3:17])


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("riverside-drive-2020-193", "rover.nav"),
        ("tokyo-rtk-2021-265", "SEPT2650.21P.gz"),
        ("nl-network-2021-001", "AMEL00NLD_R_20210010000_01D_MN.rnx.gz"),
    ],
)
def test_a_real_navigation_file_comes_back_bit_for_bit(
    shared_data: Path, tmp_path: Path, name: str, file: str
) -> None:
    text = (SPECS / f"{name}.toml").read_text()
    streams = text.index("[streams.")
    spec = tmp_path / "nav.toml"
    spec.write_text(text[:streams] + '[streams.nav]\nsource = "nav"\n')
    import_log(spec, shared_data / name, tmp_path / "nav.mcap")
    with LogReader(tmp_path / "nav.mcap") as log:
        found = ephemeris_records(log.read(NAV))
    source = read_file(shared_data / name / file, Findings(), mend="")
    expected = read_rinex_nav(source, Findings()).ephemerides
    assert len(expected) > 70
    bits = {record.tobytes() for record in expected}
    assert len(bits) == len(expected)
    assert {record.tobytes() for record in found} == bits and len(found) == len(bits)


def test_tokyo_rtk_agrees_with_a_plain_reading(shared_data: Path, tmp_path: Path) -> None:
    folder, result = real("tokyo-rtk-2021-265", shared_data, tmp_path / "out.mcap")
    assert result.exit_code is ExitCode.OK
    types = {
        "G": ["C1C", "L1C", "S1C", "C1W", "S1W", "C2W", "L2W", "S2W", "C2L", "L2L", "S2L"]
        + ["C5Q", "L5Q", "S5Q"],
        "E": ["C1C", "L1C", "S1C", "C5Q", "L5Q", "S5Q", "C7Q", "L7Q", "S7Q", "C8Q", "L8Q", "S8Q"],
        "J": ["C1C", "L1C", "S1C", "C2L", "L2L", "S2L", "C5Q", "L5Q", "S5Q"],
    }
    kinds = {"C": "pseudorange_m", "L": "carrier_phase_cycles", "S": "cn0_dbhz"}
    expected: dict[str, list[float]] = {name: [] for name in kinds.values()}
    for line in lines_after_header(folder / "SEPT265G.21O.gz"):
        if line.startswith(">"):
            continue
        for place, name in enumerate(types[line[0]]):
            field = line[3 + 16 * place : 17 + 16 * place].strip()
            if field:
                expected[kinds[name[0]]].append(float(field))
    with LogReader(tmp_path / "out.mcap") as log:
        obs = log.read(OBS)
    for name, values in expected.items():
        found = np.sort(obs[name][obs.is_present(name)])
        np.testing.assert_array_equal(found, np.sort(values))
