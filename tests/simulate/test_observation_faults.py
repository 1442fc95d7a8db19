"""Noise, slips, gaps and walls do what the scenario says, and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest
from scipy import signal as filters
from scipy import stats

from replay import channels
from replay.errors import ConfigurationError
from replay.kernels import tracking
from replay.simulate.observations import butterworth_pole
from tests.simulate.observing import (
    DRIVE,
    FREQUENCY,
    NO_AIR,
    START_NS,
    C,
    base,
    make,
    receiver,
    series,
    signals_of,
)

LONG = [{"kind": "hold", "duration": 300.0}]
QUIET = {"acquisition": 0.0}


def elevations(made, name):
    """Sine of the elevation of each row, from C/N0: nothing else is in it here."""
    return (made.observations(name)["cn0_dbhz"] - 38.0) / 12.0


@pytest.mark.parametrize(
    ("field", "noise", "sigma"),
    [
        ("pseudorange_m", {"code": 0.5}, 0.5),
        ("carrier_phase_cycles", {"carrier": 0.002}, 0.002),
        ("doppler_hz", {"rate": 0.04}, 0.04),
    ],
)
def test_noise_is_white_normal_and_grows_to_the_horizon(field, noise, sigma):
    clean = make(base(), sky=NO_AIR, segments=LONG)
    noisy = make(base(noise=noise), sky=NO_AIR, segments=LONG)
    a, b = clean.observations("base"), noisy.observations("base")
    np.testing.assert_array_equal(a.valid_time_ns, b.valid_time_ns)
    keys = [s.decode()[0] + c.decode() for s, c in zip(a["satellite"], a["signal"], strict=True)]
    to_metres = 1.0
    if field != "pseudorange_m":
        to_metres = np.array([C / FREQUENCY[key] for key in keys])
    errors = (b[field] - a[field]) * to_metres * elevations(clean, "base") / sigma
    n = len(errors)
    assert n > 10_000
    low, high = stats.chi2.interval(0.9999, n)
    assert low < np.sum(errors**2) < high
    assert abs(errors.mean()) < 4.0 / math.sqrt(n)
    assert stats.kstest(errors, "norm").pvalue > 1e-3
    per_signal = [errors[i :: n // 50][:50] for i in range(3)]
    assert all(abs(np.corrcoef(x[1:], x[:-1])[0, 1]) < 0.6 for x in per_signal)
    for other in ("pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz"):
        if other != field:
            np.testing.assert_array_equal(a[other], b[other])


def test_the_low_pass_is_butterworths():
    white = np.random.default_rng(3).standard_normal(200_000)
    cutoff, rate = 0.02, 1.0
    b, a = filters.butter(1, cutoff, fs=rate)
    pole = butterworth_pole(cutoff, 1.0 / rate)
    assert pole == pytest.approx(-a[1], rel=1e-12)
    gain = math.sqrt(0.5 * (1.0 - pole))
    made = white.copy()
    tracking.low_pass(pole, gain, made)
    # Both begin with the first number, as if it had stood for ever.
    scale = gain / b[0]
    state = [white[0] - gain * white[0]]
    expected = scale * filters.lfilter(b, a, white, zi=np.array(state) / scale)[0]
    np.testing.assert_allclose(made, expected, atol=1e-12)
    assert made.std() == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("kind", ["gauss-markov", "butterworth"])
def test_multipath_is_correlated_and_of_its_size(kind):
    path = {"filter": kind, "code": 0.4, "carrier": 0.003, "tau": 10.0, "cutoff": 1.0 / 63.0}
    clean = make(base(), sky=NO_AIR, segments=LONG)
    noisy = make(base(multipath=path), sky=NO_AIR, segments=LONG)
    scaled, neighbours, count = 0.0, 0.0, 0
    for satellite, code in signals_of(clean.observations("base")):
        a = series(clean.observations("base"), satellite, code)
        b = series(noisy.observations("base"), satellite, code)
        if len(a["time"]) < 299:
            continue
        sine = (a["cn0_dbhz"] - 38.0) / 12.0
        x = (b["pseudorange_m"] - a["pseudorange_m"]) * sine / 0.4
        y = (b["carrier_phase_cycles"] - a["carrier_phase_cycles"]) * sine / 0.003
        y *= C / FREQUENCY[satellite[0] + code]
        assert 0.1 < y.std() < 2.5
        scaled += np.sum(x * x)
        neighbours += np.sum(x[1:] * x[:-1])
        count += len(x)
    assert scaled / count == pytest.approx(1.0, abs=0.2)
    correlation = neighbours / scaled
    # exp(-T / tau); the low-pass's (1 + pole) / 2 at the same time constant, 1 / (2 pi f).
    assert correlation == pytest.approx(0.905 if kind == "gauss-markov" else 0.953, abs=0.02)


def test_listed_slips_stand_at_their_time_with_their_size():
    whole = make(base(), sky=NO_AIR, segments=LONG)
    names = [s for s, code in signals_of(whole.observations("base")) if code == "1C"]
    slips = [
        {"receiver": "base", "satellite": names[0], "signal": "1C", "time": 100.0, "cycles": 3},
        {"receiver": "base", "satellite": names[0], "signal": "1C", "time": 150.2, "cycles": -1},
        {"receiver": "base", "satellite": names[1], "time": 120.0, "cycles": 7},
    ]
    made = make(base(tracking={"flagged": 0.0}), sky=NO_AIR, segments=LONG, slips=slips)
    expected = {(names[0], "1C"): {100: 3, 151: -1}}
    for satellite, code in signals_of(whole.observations("base")):
        if satellite == names[1]:
            expected[satellite, code] = {120: 7}
        a = series(whole.observations("base"), satellite, code)
        b = series(made.observations("base"), satellite, code)
        steps = np.diff(b["carrier_phase_cycles"] - a["carrier_phase_cycles"])
        at = np.flatnonzero(np.abs(steps) > 1e-6)
        found = {int((b["time"][i + 1] - START_NS) // 10**9): round(steps[i]) for i in at}
        assert found == expected.get((satellite, code), {})
        assert not b["flag"].any()
    told = {(s["satellite"], s["signal"], s["time_ns"], s["cycles"]) for s in made.slips}
    assert (names[0], "1C", START_NS + 151 * 10**9, -1) in told
    assert len(told) == 4


def test_random_slips_come_at_their_rate_and_are_told_as_often_as_asked():
    keys = {"slips_per_hour": 120.0, "largest_slip": 5, "flagged": 0.3}
    made = make(base(tracking=keys), sky=NO_AIR, segments=LONG)
    columns = made.observations("base")
    expected = len(columns) / 30.0
    assert stats.poisson.interval(0.9999, expected)[0] < len(made.slips)
    assert len(made.slips) < stats.poisson.interval(0.9999, expected)[1]
    assert {abs(s["cycles"]) for s in made.slips} == {1, 2, 3, 4, 5}
    up = sum(s["cycles"] > 0 for s in made.slips)
    flagged = sum(s["flagged"] for s in made.slips)
    for count, share in ((up, 0.5), (flagged, 0.3)):
        low, high = stats.binom.interval(0.9999, len(made.slips), share)
        assert low < count < high
    assert int(np.count_nonzero(columns["loss_of_lock"])) == flagged


def elapsed(columns):
    return (columns.valid_time_ns - START_NS) / 1e9


def test_a_roof_leaves_the_lowest_and_an_outage_the_highest():
    spans = [
        {"kind": "roof", "begin": 10.0, "end": 14.0, "keep": 3, "every": 30.0},
        {"kind": "outage", "begin": 20.0, "end": 25.0, "keep": 4},
    ]
    one = receiver(tracking=QUIET)
    free = make(one, sky=NO_AIR, segments=[{"kind": "hold", "duration": 60.0}])
    made = make(one, sky=NO_AIR, segments=[{"kind": "hold", "duration": 60.0}], blockage=spans)
    a, b = free.observations("rover"), made.observations("rover")
    height = dict(zip(a["satellite"].tolist(), elevations(free, "rover"), strict=True))
    order = sorted(height, key=lambda name: height[name])
    t = elapsed(b)
    for begin, end, kept in ((10, 14, order[:3]), (40, 44, order[:3]), (20, 25, order[-4:])):
        inside = (t >= begin) & (t < end)
        assert set(b["satellite"][inside].tolist()) == set(kept)
    outside = lambda t: ~(((t % 30 >= 10) & (t % 30 < 14)) | ((t >= 20) & (t < 25)))  # noqa: E731
    assert np.count_nonzero(outside(t)) == np.count_nonzero(outside(elapsed(a)))
    hidden = order[len(order) // 2].decode()
    again = series(b, hidden, signals_of(b)[[s for s, _ in signals_of(b)].index(hidden)][1])
    back = (again["time"] - START_NS) // 10**9 == 14
    assert again["lock_time_s"][back] == 0.0
    assert again["flag"][back] == 1


def test_carrier_starts_anew_with_other_cycles_after_an_outage():
    span = [{"kind": "outage", "begin": 10.0, "end": 15.0}]
    made = make(receiver(tracking={"acquisition": 3.0}), sky=NO_AIR, blockage=span)
    t = elapsed(made.observations("rover"))
    assert sorted(set(t.tolist())) == [*range(1, 10), *range(18, 31)]
    arcs: dict[tuple[str, str], list[int]] = {}
    for _, satellite, code, first, last, cycles in made.arcs:
        arcs.setdefault((satellite, code), []).append(cycles)
        assert (first, last) in (
            (START_NS + 10**9, START_NS + 9 * 10**9),
            (START_NS + 18 * 10**9, START_NS + 30 * 10**9),
        )
    assert all(len(c) == 2 and c[0] != c[1] for c in arcs.values())


def test_a_street_hides_what_its_walls_cover():
    wall = [{"kind": "canyon", "begin": 8.0, "end": 60.0, "left": "60 deg", "right": "35 deg"}]
    one = receiver(tracking=QUIET)
    free = make(one, sky=NO_AIR, segments=DRIVE)
    made = make(one, sky=NO_AIR, segments=DRIVE, blockage=wall)
    a, b = free.observations("rover"), made.observations("rover")
    left = set(zip(b.valid_time_ns.tolist(), b["satellite"].tolist(), strict=True))
    truth = free.rows[channels.TRUTH.topic]
    checked = {True: 0, False: 0}
    for time_ns, name in set(zip(a.valid_time_ns.tolist(), a["satellite"].tolist(), strict=True)):
        if time_ns - START_NS < 8 * 10**9:
            continue
        row = int(np.searchsorted(truth.valid_time_ns, time_ns))
        azimuth, elevation = look(free, name.decode(), time_ns, truth["position_ecef_m"][row])
        beside = azimuth - truth["attitude_rad"][row, 2]
        across = math.sin(beside)
        limit = math.tan(math.radians(35.0 if across > 0.0 else 60.0)) * abs(across)
        margin = math.tan(elevation) - limit
        if abs(margin) > 1e-4:
            assert ((time_ns, name) in left) == (margin > 0.0)
            checked[margin > 0.0] += 1
    assert min(checked.values()) > 100


def look(made, satellite, time_ns, place):
    """Azimuth and elevation (rad) from the ephemeris, by pymap3d."""
    from tests.simulate.observing import WGS84_RATE, message, orbit, travel_and_clock, turn_z

    m = message(made, satellite)
    travel, _ = travel_and_clock(m, place, time_ns, 0.0)
    then, _ = orbit(m, (time_ns - m["toe_ns"]) / 1e9 - travel)
    geodetic = pymap3d.ecef2geodetic(*place)
    azimuth, elevation, _ = pymap3d.ecef2aer(*(turn_z(WGS84_RATE * travel) @ then), *geodetic)
    return math.radians(azimuth), math.radians(elevation)


def test_reflected_codes_are_long_and_have_no_carrier():
    wall = {"kind": "canyon", "begin": 5.0, "end": 60.0, "left": 1.2, "right": 1.2}
    one = receiver(tracking=QUIET, multipath={"detour": 30.0})
    free = make(one, sky=NO_AIR, segments=DRIVE)
    made = make(one, sky=NO_AIR, segments=DRIVE, blockage=[{**wall, "reflected": 1.0}])
    a, b = free.observations("rover"), made.observations("rover")
    np.testing.assert_array_equal(a["satellite"], b["satellite"])
    detour = b["pseudorange_m"] - a["pseudorange_m"]
    bare = ~b.is_present("carrier_phase_cycles")
    assert bare.any()
    assert (detour[~bare] == 0.0).all()
    assert (detour[bare] >= 0.0).all()
    assert 15.0 < detour[bare].mean() < 45.0


def test_trees_cost_strength_and_add_noise():
    trees = {"kind": "trees", "begin": 5.0, "end": 60.0, "left": 1.3, "right": 1.3, "loss_db": 8.0}
    one = receiver(tracking=QUIET, noise={"code": 0.5})
    free = make(one, sky=NO_AIR, segments=DRIVE)
    made = make(one, sky=NO_AIR, segments=DRIVE, blockage=[trees])
    a, b = free.observations("rover"), made.observations("rover")
    keys = list(zip(a.valid_time_ns, a["satellite"], a["signal"], strict=True))
    index = {key: row for row, key in enumerate(keys)}
    rows = [index[key] for key in zip(b.valid_time_ns, b["satellite"], b["signal"], strict=True)]
    loss = a["cn0_dbhz"][rows] - b["cn0_dbhz"]
    weak = loss > 0.0
    assert weak.sum() > 200
    assert loss[weak].min() >= 4.0
    assert loss[weak].max() <= 12.0
    clean = make(receiver(tracking=QUIET), sky=NO_AIR, segments=DRIVE).observations("rover")
    free_noise = (a["pseudorange_m"] - clean["pseudorange_m"])[rows]
    tree_noise = b["pseudorange_m"] - clean["pseudorange_m"][rows]
    np.testing.assert_allclose(tree_noise, free_noise * 10.0 ** (loss / 20.0), atol=1e-5)


def test_a_new_blockage_or_receiver_shifts_no_number_of_others():
    first = make(base(noise={"code": 1.0}), sky=NO_AIR)
    second = make(
        base(noise={"code": 1.0}), receiver(), sky=NO_AIR,
        blockage=[{"kind": "roof", "begin": 5.0, "end": 9.0}],
    )  # fmt: skip
    a, b = first.observations("base"), second.observations("base")
    np.testing.assert_array_equal(a["pseudorange_m"], b["pseudorange_m"])


def test_a_listed_slip_without_a_carrier_is_refused():
    slip = {"receiver": "base", "satellite": "G99", "time": 10.0, "cycles": 1}
    with pytest.raises(ConfigurationError, match="G99"):
        make(base(), sky=NO_AIR, slips=[slip])
