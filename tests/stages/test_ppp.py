"""The stage `ppp` on real stations: cuts, dumps, a position, and what phases' biases make whole."""

from __future__ import annotations

import numpy as np
import pytest

from replay import channels, configuration
from replay.gnss.measurements import SATELLITE_NAMES, gather_epochs, select_signals
from replay.stages.base import Context, Port
from replay.stages.ppp import Ppp, clock_codes
from replay.stages.ppp_config import PppConfig
from replay.stages.precise_satellites import PreciseSatellites
from replay.stages.waiting import read_epochs
from tests.stages.gnss_chain import COARSE, CORRECTIONS, OBS, SATELLITES, SOLUTION, logged, run
from tests.stages.precise_logs import SIGNALS, folder_of, station_log

C_M_S = 299792458.0
STATUS_FIXED = 7
AMBIGUITIES = channels.FILTER_AMBIGUITIES.name
# The mark by float solutions over a day, m, in the frame of the products; the antenna's
# reference point, which the stage tells, stands 0.216 m above it.
MARK = np.array([3582104.75, 532590.18, 5232755.13])
ESBC = MARK + 0.216 * MARK / np.linalg.norm(MARK)
GAP = {"ppp": {"phases": {"gap": 65.0}}}


def settings(name, *tables):
    signals = {"gnss": {"signals": SIGNALS[name]}}
    return configuration.build(PppConfig, [signals, GAP, *tables])


def sights(name, folder, first, count):
    """Some epochs of a station with what the stage before says of them."""
    folder_of(name)
    inputs = station_log(name, folder)
    times = np.unique(inputs[OBS].valid_time_ns)[first : first + count]
    inputs = {**inputs, OBS: inputs[OBS].take(np.isin(inputs[OBS].valid_time_ns, times))}
    stage = PreciseSatellites()
    _, outputs = stage.step(stage.start(settings(name), Context({}, {})), inputs)
    chosen = {key: logged(key, outputs[key]) for key in (SATELLITES, CORRECTIONS, COARSE)}
    return {OBS: inputs[OBS], **chosen}


@pytest.fixture(scope="module")
def ccj2(tmp_path_factory):
    """An hour of GPS, GLONASS and Galileo with biases of codes and phases."""
    return sights("ccj2", tmp_path_factory.mktemp("ccj2"), 0, 120)


@pytest.fixture(scope="module")
def esbc(tmp_path_factory):
    """Two hours of GPS, GLONASS and Galileo with orbits and clocks alone."""
    return sights("esbc", tmp_path_factory.mktemp("esbc"), 0, 240)


def local(position, place):
    """East, north, up of positions about a place."""
    up = place / np.linalg.norm(place)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return (position - place) @ np.stack([east, np.cross(up, east), up]).T


@pytest.mark.parametrize("mode", ["float", "fix-and-hold"])
def test_cuts_and_dumps_change_no_bit(ccj2, mode):
    config = settings("ccj2", {"ppp": {"ambiguities": {"mode": mode}}})
    whole = run(Ppp(), config, ccj2)
    times = np.unique(ccj2[OBS].log_time_ns)
    edges = times[[0, 17, 18, 60, 97]].tolist()
    for dump_at in (None, 1, 4):
        pieces = run(Ppp(), config, ccj2, edges, dump_at=dump_at)
        assert pieces.bytes() == whole.bytes()
        assert pieces.stage.dump(pieces.state) == whole.stage.dump(whole.state)


def test_a_station_stands_where_a_day_says(esbc):
    config = settings("esbc")
    solution = run(Ppp(), config, esbc).outputs[SOLUTION]
    error = local(solution["position_ecef_m"], ESBC)
    assert len(solution) == 240
    # Kinematic and float: decimetres at first, centimetres after an hour.
    rms = np.sqrt(np.mean(error[120:] ** 2, axis=0))
    assert rms[:2].max() < 0.05
    assert rms[2] < 0.1
    static = settings("esbc", {"ppp": {"motion": {"dynamics": "static"}}})
    solution = run(Ppp(), static, esbc).outputs[SOLUTION]
    assert np.abs(local(solution["position_ecef_m"][-1], ESBC)).max() < 0.05


def test_codes_of_clocks_stand_in_before_corrections(esbc):
    codes = clock_codes(settings("esbc"), Context({}, {}))
    chosen = select_signals(SIGNALS["esbc"], "G")
    plain, found = (read_epochs(esbc, chosen, codes=c).rows for c in (None, codes))
    raw, taken = (gather_epochs(esbc[OBS], chosen, codes=c).rows for c in (None, codes))
    bias = taken["code"][:, 0] - raw["code"][:, 0]
    known = np.isfinite(bias)
    assert known.sum() > 1000
    # What is corrected is the same for both codes: their difference stays as it was received.
    shift = found["code"][known, 0] - plain["code"][known, 0]
    np.testing.assert_allclose(shift, bias[known], atol=2e-8)
    names = found["satellite"][known]
    each = [np.median(bias[known][names == number]) for number in np.unique(names)]
    assert np.ptp(each) > 0.5  # biases of satellites, published as up to 2 ns each way


def test_codes_stay_where_biases_are_known_or_clocks_are_broadcast(ccj2):
    config = settings("esbc")
    bias = Port(channels.SIGNAL_BIAS).name
    assert clock_codes(config, Context({}, {})) is not None
    assert clock_codes(config, Context({}, {bias: ccj2[CORRECTIONS]})) is None
    unused = settings("esbc", {"products": {"biases": False}})
    assert clock_codes(unused, Context({}, {bias: ccj2[CORRECTIONS]})) is not None
    for table in ({"source": "broadcast"}, {"clock_codes": []}):
        assert clock_codes(settings("esbc", {"products": table}), Context({}, {})) is None


def test_without_biases_of_phases_nothing_is_fixed(esbc):
    some = {key: rows.take(slice(0, len(rows) // 4)) for key, rows in esbc.items()}
    resolved = settings("esbc", {"ppp": {"ambiguities": {"mode": "continuous"}}})
    found, plain = run(Ppp(), resolved, some).outputs, run(Ppp(), settings("esbc"), some).outputs
    assert AMBIGUITIES not in found
    assert not np.any(found[SOLUTION]["status"] == STATUS_FIXED)
    same = found[SOLUTION]["position_ecef_m"] == plain[SOLUTION]["position_ecef_m"]
    assert np.all(same)


def biased_rows(inputs):
    """Records of both slots whose phases' biases are known, and their times."""
    found = gather_epochs(
        inputs[OBS], select_signals(SIGNALS["ccj2"], "GE"),
        inputs[SATELLITES], inputs[CORRECTIONS], inputs[COARSE],
    )  # fmt: skip
    good = (found.rows["seen"] == 1) & (found.rows["phase_known"][:, :2] == 1).all(axis=1)
    good &= np.isfinite(found.rows["phase"][:, :2] + found.rows["code"][:, :2]).all(axis=1)
    return found.rows[good]


def wide_lanes(rows, *, code_biases):
    """Melbourne-Wuebbena combination of both slots, cycles; what both share drops out."""
    f1, f2 = rows["frequency"][:, 0], rows["frequency"][:, 1]
    code, phase = rows["code"] - code_biases * rows["group_delay"], rows["phase"]
    lane = (f1 * phase[:, 0] - f2 * phase[:, 1]) / (f1 - f2)
    narrow = (f1 * code[:, 0] + f2 * code[:, 1]) / (f1 + f2)
    return (lane - narrow) * (f1 - f2) / C_M_S


def fractions(values):
    """Cycles from the nearest integers and one number that all share; how near they keep."""
    turns = np.exp(2j * np.pi * np.asarray(values)).mean()
    return (values - np.angle(turns) / (2 * np.pi) + 0.5) % 1.0 - 0.5, abs(turns)


@pytest.mark.parametrize("system", [0, 2])
def test_wide_lanes_are_whole_with_biases_and_only_so(ccj2, system):
    rows = biased_rows(ccj2)
    near = {}
    for code_biases in (1.0, -1.0):
        value = wide_lanes(rows, code_biases=code_biases)
        means = []
        for satellite in np.unique(rows["satellite"][rows["system"] == system]):
            own = rows["satellite"] == satellite
            # Where nothing broke all along, and reflections are not the most of it.
            if own.sum() < 100 or rows["elevation"][own].mean() < np.radians(20.0):
                continue
            assert np.abs(np.diff(value[own])).max() < 3.0
            means.append(value[own].mean())
        assert len(means) >= 5
        away, near[code_biases] = fractions(np.array(means))
        if code_biases == 1.0:
            assert np.abs(away).max() < 0.2
            assert np.mean(np.abs(away) < 0.15) > 0.75
    assert near[1.0] > 0.85
    assert near[-1.0] < 0.6


def test_narrow_lanes_are_whole_at_the_end_of_the_hour(ccj2):
    outputs = run(Ppp(), settings("ccj2"), ccj2).outputs
    phases = outputs[channels.FILTER_PHASES.name]
    last = phases.take(phases.valid_time_ns == phases.valid_time_ns[-1])
    rows = biased_rows(ccj2)
    high = {
        SATELLITE_NAMES[row["satellite"]]: row
        for row in rows[-30:]
        if row["elevation"] > np.radians(25.0)
    }
    for letter in (b"G", b"E"):
        narrow = []
        for name, row in high.items():
            own = {
                last["signal"][k]: last["ambiguity_m"][k]
                for k in np.flatnonzero(last["satellite"] == name)
                if last["epoch_count"][k] > 100
            }
            if not name.startswith(letter) or len(own) < 2:
                continue
            f1, f2 = row["frequency"][:2]
            n1, n2 = own[min(own)] * f1 / C_M_S, own[max(own)] * f2 / C_M_S
            free = (f1**2 * own[min(own)] - f2**2 * own[max(own)]) / (f1**2 - f2**2)
            narrow.append((n1 - n2, free * (f1 + f2) / C_M_S, f2 / (f1 - f2)))
        lanes, free, factor = np.array(narrow).T
        assert len(lanes) >= 4
        away, _ = fractions(lanes)
        away, near = fractions(free - factor * np.round(lanes - (lanes - away)[0] % 1.0))
        assert np.abs(away).max() < 0.25
        assert near > 0.85


def test_integers_bring_a_kinematic_station_together(ccj2):
    found = run(
        Ppp(), settings("ccj2", {"ppp": {"ambiguities": {"mode": "continuous"}}}), ccj2
    ).outputs
    plain = run(Ppp(), settings("ccj2"), ccj2).outputs[SOLUTION]
    solution = found[SOLUTION]
    fixed = solution["status"] == STATUS_FIXED
    assert fixed.mean() > 0.5
    assert fixed[60:].mean() > 0.95
    place = solution["position_ecef_m"][fixed].mean(axis=0)
    own = local(solution["position_ecef_m"], place)[fixed].std(axis=0)
    floats = local(plain["position_ecef_m"], place)[fixed].std(axis=0)
    assert own[0] < 0.015
    assert own[1] < 0.02
    assert np.hypot(*own[:2]) < 0.6 * np.hypot(*floats[:2])
