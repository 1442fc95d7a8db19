"""Orbits, clocks and corrections of a real drive are RTKLIB's, term by term."""

from __future__ import annotations

import numpy as np
import pymap3d
import pytest

from replay import channels
from replay.importers import import_log
from replay.log.reader import LogReader
from tests.conftest import ROOT
from tests.stages.gnss_chain import (
    COARSE,
    CORRECTIONS,
    NAV,
    OBS,
    SATELLITES,
    TERMS,
    keyed,
    satellites,
    times_of,
)

pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")

C = 299792458.0
MM = 1e-3
SECOND = 1_000_000_000
ALPHA = (0.1118e-7, -0.7451e-8, -0.5961e-7, 0.1192e-6)
BETA = (0.1167e6, -0.2294e6, -0.1311e6, 0.1049e7)
FREQUENCY = {b"1C": 1575.42e6, b"2I": 1561.098e6}


@pytest.fixture(scope="module")
def riverside(shared_data, tmp_path_factory):
    """Two minutes of a real drive by both."""
    folder = shared_data / "riverside-drive-2020-193"
    spec = ROOT / "recordings" / "specs" / "riverside-drive-2020-193.toml"
    log = tmp_path_factory.mktemp("riverside") / "in.mcap"
    import_log(spec, folder, log)
    topics = {OBS: channels.GNSS_OBS.at(receiver="rover"), NAV: channels.NAV.topic}
    with LogReader(log) as reader:
        rows = {name: reader.read(topic) for name, topic in topics.items()}
    times = times_of(rows[OBS])
    # Every tenth second over a quarter of an hour.
    keep = np.isin(rows[OBS].valid_time_ns, times[::10][:90])
    inputs = {OBS: rows[OBS].take(keep), NAV: rows[NAV]}
    ours = satellites(
        inputs,
        {"gnss": {"systems": "GEC"}},
        {"atmosphere": {"alpha": ALPHA, "beta": BETA, "troposphere": "cosecant", "shapiro": False}},
    )
    nav, obs, station = pyrtklib.nav_t(), pyrtklib.obs_t(), pyrtklib.sta_t()
    assert pyrtklib.readrnx(str(folder / "rover.nav"), 1, "", obs, nav, station) == 1
    pyrtklib.uniqnav(nav)
    return inputs, ours, nav


SYSTEM = {"G": pyrtklib.SYS_GPS, "E": pyrtklib.SYS_GAL, "C": pyrtklib.SYS_CMP}


def gtime(time_ns):
    week, rest = divmod(int(time_ns), 604_800 * SECOND)
    return pyrtklib.gpst2time(week, rest / 1e9)


def doubles(values):
    array = pyrtklib.Arr1Ddouble(len(values))
    for place, value in enumerate(values):
        array[place] = float(value)
    return array


def test_every_term_is_rtklibs(riverside):
    inputs, ours, nav = riverside
    seen, told = ours[SATELLITES], ours[CORRECTIONS]
    code = keyed(inputs[OBS], "pseudorange_m")
    terms = {name: keyed(told, name) for name in TERMS}
    sight = {
        name: keyed(seen, name, signal=False)
        for name in (
            "clock_s",
            "clock_drift_s_s",
            "elevation_rad",
            "azimuth_rad",
            "issue",
            "ephemeris_age_s",
        )
    }
    positions = dict(
        zip(
            zip(seen.valid_time_ns.tolist(), seen["satellite"].tolist(), strict=True),
            seen["position_ecef_m"],
            strict=True,
        )
    )
    ionosphere = doubles([*ALPHA, *BETA])
    compared = {"G": 0, "E": 0, "C": 0}
    for epoch, place in zip(
        ours[COARSE].valid_time_ns.tolist(), ours[COARSE]["position_ecef_m"], strict=True
    ):
        keys = [key for key in terms["wet_m"] if key[0] == epoch]
        data = pyrtklib.Arr1Dobsd_t(len(keys))
        for row, key in enumerate(keys):
            name = key[1].decode()
            data[row].time = gtime(epoch)
            data[row].sat = pyrtklib.satno(SYSTEM[name[0]], int(name[1:]))
            data[row].P[0] = code[key]
        rs, dts, var = (pyrtklib.Arr1Ddouble(size * len(keys)) for size in (6, 2, 1))
        health = pyrtklib.Arr1Dint(len(keys))
        pyrtklib.satposs(gtime(epoch), data[0], len(keys), nav, 0, rs, dts, var, health)
        here = doubles(place)
        geodetic = pyrtklib.Arr1Ddouble(3)
        pyrtklib.ecef2pos(here, geodetic)
        for row, key in enumerate(keys):
            at = doubles([rs[6 * row + k] for k in range(6)])
            line, azel = pyrtklib.Arr1Ddouble(3), pyrtklib.Arr1Ddouble(2)
            distance = pyrtklib.geodist(at, here, line)
            pyrtklib.satazel(geodetic, line, azel)
            plain = (key[0], key[1], b"")
            if key[1][:1] == b"E" and sight["ephemeris_age_s"][plain] <= 0.0:
                continue  # RTKLIB takes no message of Galileo before its reference time
            assert terms["distance_m"][key] + terms["sagnac_m"][key] == pytest.approx(
                distance, abs=2 * MM
            )
            separate = np.linalg.norm(np.array([at[k] for k in range(3)]) - place)
            assert terms["distance_m"][key] == pytest.approx(separate, abs=0.1 * MM)
            turned = np.linalg.norm(positions[key[0], key[1]] - place)
            assert turned == pytest.approx(distance, abs=0.2 * MM)
            assert sight["clock_s"][plain] == pytest.approx(dts[2 * row], abs=1e-12)
            clock = -(terms["satellite_clock_m"][key] + terms["relativity_m"][key]) / C
            assert clock == pytest.approx(dts[2 * row], abs=1e-12)
            assert sight["clock_drift_s_s"][plain] == pytest.approx(dts[2 * row + 1], abs=2e-14)
            # Its direction is that before the Earth has turned: some 30 m of 20,000 km.
            assert sight["elevation_rad"][plain] == pytest.approx(azel[1], abs=1e-5)
            assert sight["azimuth_rad"][plain] == pytest.approx(azel[0], abs=1e-4)
            own = doubles([sight["azimuth_rad"][plain], sight["elevation_rad"][plain]])
            ratio = FREQUENCY[b"1C"] / FREQUENCY[key[2]]
            delay = pyrtklib.ionmodel(gtime(epoch), ionosphere, geodetic, own) * ratio**2
            assert terms["ionosphere_m"][key] == pytest.approx(delay, abs=0.1 * MM)
            air = pyrtklib.tropmodel(gtime(epoch), geodetic, own, 0.7)
            slant = terms["hydrostatic_m"][key] + terms["wet_m"][key]
            # Its zero of Celsius is 273.16 K.
            assert slant == pytest.approx(air, rel=4e-5)
            assert terms["group_delay_m"][key] == pytest.approx(
                C * delay_of(nav, key, epoch, sight["issue"][plain]), abs=0.01 * MM
            )
            compared[key[1].decode()[0]] += 1
    assert min(compared.values()) > 150


def delay_of(nav, key, time_ns, issue):
    """RTKLIB's group delay of E1, L1 or B1I, of the message with an issue of data, s."""
    name = key[1].decode()
    number = pyrtklib.satno(SYSTEM[name[0]], int(name[1:]))
    own = [nav.eph[k] for k in range(nav.n)]
    own = [eph for eph in own if eph.sat == number and eph.iode == issue]
    now = gtime(time_ns)
    best = min(own, key=lambda eph: abs(pyrtklib.timediff(eph.toe, now)))
    return best.tgd[1 if name[0] == "E" else 0]


def test_the_sky_of_a_real_drive_is_pymap3ds(riverside):
    _, ours, _ = riverside
    seen, coarse = ours[SATELLITES], ours[COARSE]
    place = dict(zip(coarse.valid_time_ns.tolist(), coarse["position_ecef_m"], strict=True))
    here = np.array([place[t] for t in seen.valid_time_ns.tolist()])
    lat, lon, height = pymap3d.ecef2geodetic(*here.T)
    azimuth, elevation, _ = pymap3d.ecef2aer(*seen["position_ecef_m"].T, lat, lon, height)
    np.testing.assert_allclose(seen["elevation_rad"], np.radians(elevation), atol=1e-9)
    np.testing.assert_allclose(seen["azimuth_rad"], np.radians(azimuth), atol=1e-9)


def test_with_rtklibs_variances_the_place_is_rtklibs(riverside):
    """Ranges less our terms, weighted as its `rescode` does, against its `pntpos`.

    GPS and BeiDou: of Galileo it takes other messages. Our troposphere is that of the coarse
    place, of all systems and other weights: metres away, which are millimetres.
    """
    inputs, ours, nav = riverside
    for place, value in enumerate((*ALPHA, *BETA)):
        nav.ion_gps[place] = value
    option = pyrtklib.prcopt_t()
    option.mode, option.nf = pyrtklib.PMODE_SINGLE, 1
    option.navsys = pyrtklib.SYS_GPS | pyrtklib.SYS_CMP
    option.ionoopt, option.tropopt = pyrtklib.IONOOPT_BRDC, pyrtklib.TROPOPT_SAAS
    option.elmin, option.maxgdop = np.radians(15.0), 30.0
    for place, value in enumerate((100.0, 0.003, 0.003, 0.0, 1.0)):
        option.err[place] = value
    told, seen = ours[CORRECTIONS], ours[SATELLITES]
    code = keyed(inputs[OBS], "pseudorange_m")
    terms = {name: keyed(told, name) for name in TERMS}
    sight = {
        (t, name): (position, elevation)
        for t, name, position, elevation in zip(
            seen.valid_time_ns.tolist(),
            seen["satellite"].tolist(),
            seen["position_ecef_m"],
            seen["elevation_rad"].tolist(),
            strict=True,
        )
    }
    away_m = []
    for epoch, start in zip(
        ours[COARSE].valid_time_ns.tolist(), ours[COARSE]["position_ecef_m"], strict=True
    ):
        keys = [k for k in terms["wet_m"] if k[0] == epoch and k[1][:1] != b"E"]
        data = pyrtklib.Arr1Dobsd_t(len(keys))
        for row, key in enumerate(keys):
            name = key[1].decode()
            data[row].time, data[row].rcv = gtime(epoch), 1
            data[row].sat = pyrtklib.satno(SYSTEM[name[0]], int(name[1:]))
            data[row].P[0], data[row].SNR[0] = code[key], 45000
            data[row].code[0] = pyrtklib.CODE_L1C if name[0] == "G" else pyrtklib.CODE_L2I
        rs, dts, var = (pyrtklib.Arr1Ddouble(size * len(keys)) for size in (6, 2, 1))
        health = pyrtklib.Arr1Dint(len(keys))
        pyrtklib.satposs(gtime(epoch), data[0], len(keys), nav, 0, rs, dts, var, health)
        solution, azel = pyrtklib.sol_t(), pyrtklib.Arr1Ddouble(2 * len(keys))
        states, said = pyrtklib.Arr1Dssat_t(pyrtklib.MAXSAT), pyrtklib.Arr1Dchar(256)
        if not pyrtklib.pntpos(data[0], len(keys), nav, option, solution, azel, states[0], said):
            continue
        theirs = np.array([solution.rr[k] for k in range(3)])
        used = [k for k in range(len(keys)) if sight[keys[k][:2]][1] >= np.radians(15.0)]
        positions = np.array([sight[keys[k][:2]][0] for k in used])
        sine = np.sin([sight[keys[k][:2]][1] for k in used])
        delay = np.array([terms["ionosphere_m"][keys[k]] for k in used])
        variance = 100.0**2 * (0.003**2 + 0.003**2 / sine) + [var[k] for k in used]
        variance += 0.3**2 + (0.5 * delay) ** 2 + (0.3 / (sine + 0.1)) ** 2
        reduced = np.array(
            [code[keys[k]] - sum(terms[name][keys[k]] for name in TERMS[2:]) for k in used]
        )
        beidou = np.array([keys[k][1][:1] == b"C" for k in used])
        x = np.concatenate([start, [0.0, 0.0]])
        for _ in range(6):
            line = positions - x[:3]
            away = np.linalg.norm(line, axis=1)
            design = np.column_stack([-line / away[:, None], np.ones(len(used)), beidou])
            left = (reduced - away - design[:, 3:] @ x[3:]) / np.sqrt(variance)
            step = np.linalg.lstsq(design / np.sqrt(variance)[:, None], left, rcond=None)[0]
            x += step
        away_m.append(np.linalg.norm(x[:3] - theirs))
    assert len(away_m) > 60
    assert np.median(away_m) < 5 * MM
    assert max(away_m) < 50 * MM
