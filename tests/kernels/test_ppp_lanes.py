"""Integers of precise point positioning by way of wide lanes, on made-up skies."""

import numpy as np
import pytest

from replay.kernels import ppp_records as records
from replay.kernels.ppp_lanes import sure_integer
from tests.kernels.ppp_sky import C_M_S, PLACE, Sky, run, settings

FIXED, FLOAT = 7, 6
RESOLVE = {
    "mode": 1, "partial": 1, "lock": 1, "threshold": 2.0, "agree": 3, "lane_sigma": 0.08,
    "geometry_free_rate": 1e-3, "code_gate": 4.0, "phase_gate": 4.0, "ionosphere_noise": 4e-3,
    "dynamics": records.KINEMATIC, "drops": 6,
}  # fmt: skip


def sky(**changes):
    return Sky(**{"systems": (0, 2), "each": 9, "code_noise": 0.3, "phase_noise": 0.002, **changes})


def wrong_integers(made, ambiguities):
    """How many integers that were believed are not those that were put in, and how many are."""
    wrong = right = 0
    for row in ambiguities[np.isin(ambiguities["status"], (2, 4))]:
        system = 0 if row["satellite"] < 64 else 2
        first = {0: 0, 2: 64}[system]
        k = made.satellites.index((system, row["satellite"] - first))
        j = made.satellites.index((system, row["reference"] - first))
        slot = row["signal"] // 256 - 67
        good = row["integer"] == made.cycles[k, slot] - made.cycles[j, slot]
        right, wrong = right + good, wrong + (not good)
    return wrong, right


@pytest.mark.parametrize("slots", [2, 3])
@pytest.mark.parametrize("mode", [1, records.HOLD])
def test_known_integers_are_found_and_no_others(slots, mode):
    made = sky(slots=slots)
    result = run(settings(slots=slots, **{**RESOLVE, "mode": mode}), *made.epochs(range(120)))
    status = result.solutions["status"]
    assert np.mean(status[-40:] == FIXED) > 0.9
    wrong, right = wrong_integers(made, result.ambiguities)
    assert wrong == 0
    assert right > 500
    error = np.abs(result.solutions["r"] - PLACE)[status == FIXED]
    assert error.max() < 0.05


def test_integers_are_believed_when_several_epochs_agree():
    first = []
    for agree in (0, 6):
        made = sky()
        result = run(settings(**{**RESOLVE, "agree": agree}), *made.epochs(range(100)))
        first.append(int(np.flatnonzero(result.solutions["status"] == FIXED)[0]))
    assert first[1] >= first[0] + 5


def biased(made, epochs, rows, code=0.0, phase=0.0):
    """Biases by satellite that nobody knows of: codes' (m), phases' (cycle)."""
    generator = np.random.default_rng(5)
    for satellite in np.unique(rows["satellite"]):
        own = rows["satellite"] == satellite
        for slot in range(2):
            wavelength = C_M_S / rows["frequency"][own, slot]
            rows["code"][own, slot] += code * generator.uniform(-1.0, 1.0)
            rows["phase"][own, slot] += phase * wavelength * generator.uniform(-1.0, 1.0)
    return epochs, rows


def test_codes_biased_within_what_is_allowed_do_not_harm():
    made = sky()
    result = run(settings(**RESOLVE), *biased(made, *made.epochs(range(120)), code=0.1))
    wrong, right = wrong_integers(made, result.ambiguities)
    assert wrong == 0
    assert right > 300


def test_phases_of_wrong_biases_are_refused():
    made = sky()
    result = run(settings(**RESOLVE), *biased(made, *made.epochs(range(120)), phase=0.5))
    assert np.mean(result.solutions["status"] == FIXED) < 0.1


def test_odds_of_an_integer():
    # Logarithm of the ratio of the two normal densities; ten thousand to one is asked for.
    for fraction in (0.0, 0.1, 0.3, 0.45):
        for sigma in (0.02, 0.1, 0.2, 0.4):
            for whole in (-7, 0, 3):
                value = whole + fraction
                odds = ((1.0 - fraction) ** 2 - fraction**2) / (2.0 * sigma**2)
                assert sure_integer(value, sigma**2) == (odds > 9.2)


def moved(made, epochs, rows, velocity):
    """Doppler and satellites' velocities of a receiver that goes straight on."""
    for place, epoch in enumerate(epochs):
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        t = place * made.interval
        for row in part:
            first = {0: 0, 2: 64}[int(row["system"])]
            k = made.satellites.index((int(row["system"]), int(row["satellite"]) - first))
            step = 0.5
            ends = []
            for s in (-step, step):
                elevation, azimuth = made.direction(k, t + s)
                line = [
                    np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth),
                    np.sin(elevation),
                ]  # fmt: skip
                ends.append(np.array(line) @ local_axes_of_place())
            row["velocity"] = velocity + 22e6 * (ends[1] - ends[0]) / (2.0 * step)
            u = row["position"] - made.place(t)
            u /= np.linalg.norm(u)
            rate = u @ (row["velocity"] - velocity) + 0.1
            row["range_rate"][:2] = rate + 0.02 * made.generator.normal()
    return epochs, rows


def local_axes_of_place():
    up = PLACE / np.linalg.norm(PLACE)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return np.stack([east, np.cross(up, east), up])


@pytest.mark.parametrize("slots", [2, 3])
def test_a_vehicle_with_doppler_and_further_frequencies(slots):
    velocity = np.array([3.0, -4.0, 2.0])
    made = sky(slots=slots, place=lambda t: PLACE + velocity * t, interval=1.0)
    made.turn *= 0.3
    epochs, rows = moved(made, *made.epochs(range(300)), velocity)
    config = settings(
        slots=slots, **{**RESOLVE, "dynamics": records.VELOCITY, "process_noise": 0.1},
        drift_noise=0.1,
    )  # fmt: skip
    result = run(config, epochs, rows)
    error = result.solutions["r"] - [made.place(t) for t in range(300)]
    assert np.abs(error[200:]).max() < 0.3
    assert np.abs(result.x[3:6] - velocity).max() < 0.05
    doppler = result.innovations[result.innovations["kind"] == 9]
    assert len(doppler) == 300 * 18
    assert np.mean(doppler["accepted"]) > 0.95
    wrong, _ = wrong_integers(made, result.ambiguities)
    assert wrong == 0


def test_a_model_of_the_ionosphere_helps_at_first_and_is_not_believed_later():
    """The slant delays left are centimetres: told so, the filter starts nearer to them."""
    errors = {}
    for name in ("constrained", "free"):
        made = sky(code_noise=0.5, slant=lambda sat, t: 0.02 * (sat % 5) + 1e-5 * t)
        kind = getattr(records, "IONOSPHERE_" + name.upper())
        config = settings(
            ionosphere=kind, constraint_sigma=0.05, constraint_time=600.0,
            **{**RESOLVE, "mode": records.FLOAT_ONLY},
        )  # fmt: skip
        result = run(config, *made.epochs(range(120)))
        errors[name] = np.abs(result.solutions["r"] - PLACE)
        end = result.slants[result.slants["t"] == result.slants["t"][-1]]
        for row in end:
            assert abs(row["value"] - made.slant(row["satellite"], 119 * 30.0)) < 0.1
    assert np.sqrt(np.mean(errors["constrained"][:5] ** 2)) < 0.7 * np.sqrt(
        np.mean(errors["free"][:5] ** 2)
    )
    assert errors["constrained"][-1].max() < 0.05
