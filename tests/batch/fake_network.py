"""A network of stations and a rover in closed form: every channel that a run of one can hold.

Each satellite's error is a plane over the stations, so that corrections are known exactly;
what is wrong in it (integers, test) is put there on purpose and counted by `PLANTED`.
"""

from __future__ import annotations

import numpy as np

from replay.gnss.signals import wavelength_m
from replay.log.columns import Columns, Ragged
from replay.schemas import sights_pb2, solution_pb2
from tests.view import fake_run
from tests.view.fake_run import _ecef_origin, _motion, ns

SATELLITES = ("G02", "G05", "G08", "G12", "G20", "G29")
SIGNALS = ("1C", "2W")
STATIONS = {
    "mref": (-30_000.0, 40_000.0),
    "ref1": (60_000.0, 45_000.0),
    "ref2": (65_000.0, -60_000.0),
    "ref3": (-35_000.0, -55_000.0),
}
BASELINES = ("mref-ref1", "mref-ref2", "mref-ref3", "ref1-ref2", "ref1-ref3", "ref2-ref3")
LEFT_M = 0.003  # that the corrections leave
CHANGE_S = 80.0  # when the reference satellite changes
CONVERGED_S = 5.0
PLANTED = {"tried": 20, "refused": 4, "wrong": 3, "closure": 6}
FIXED = sights_pb2.AMBIGUITY_STATUS_FIXED
FLOAT = sights_pb2.AMBIGUITY_STATUS_FLOAT
_RATIO = (wavelength_m("G", 2) / wavelength_m("G", 1)) ** 2
_FACTOR = {"1C": 1.0, "2W": _RATIO}


class _World:
    def __init__(self, duration_s: float, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.t = np.arange(2.0, duration_s - 1.0, 1.0) + 0.005
        self.slope = rng.uniform(-3e-6, 3e-6, (len(SATELLITES), 2))
        self.cycles = {
            (name, s, signal): int(rng.integers(-90, 90))
            for name in (*STATIONS, "rover")
            for s in SATELLITES
            for signal in SIGNALS
        }
        self.plane = {name: np.tile(en, (len(self.t), 1)) for name, en in STATIONS.items()}
        self.plane["rover"] = _motion(self.t)[0][:, :2]

    def reference(self, baseline: str = "") -> np.ndarray:
        """Reference satellite of each epoch; one baseline has its own."""
        early, late = ("G29", "G29") if baseline == "ref1-ref2" else ("G05", "G12")
        return np.where(self.t < CHANGE_S, early, late)

    def error(self, name: str, satellite: str, signal: str) -> np.ndarray:
        """Error of a phase [m] (n,)."""
        slope = self.slope[SATELLITES.index(satellite)]
        return _FACTOR[signal] * (self.plane[name] @ slope)

    def integer(self, station: str, master: str, satellite: str, ref: str, signal: str) -> int:
        if signal == "WL":
            first, second = (
                self.integer(station, master, satellite, ref, name) for name in SIGNALS
            )
            return first - second
        cycles = self.cycles
        return (
            cycles[station, satellite, signal] - cycles[station, ref, signal]
            - cycles[master, satellite, signal] + cycles[master, ref, signal]
        )  # fmt: skip

    def difference(
        self, station: str, master: str, satellite: str, ref: np.ndarray, signal: str
    ) -> np.ndarray:
        """Double-differenced error [m] (n,)."""
        total = self.error(station, satellite, signal) - self.error(master, satellite, signal)
        for name in np.unique(ref):
            of = ref == name
            other = self.error(station, name, signal) - self.error(master, name, signal)
            total[of] -= other[of]
        return total


def make_network(
    duration_s: float = 160.0, *, run: str = "network", single: bool = False, seed: int = 5
) -> dict[str, Columns]:
    """Every channel of a run with a network, or of one in single mode."""
    world = _World(duration_s, seed)
    out = fake_run.make_channels(duration_s, imu_hz=10, runs=(run,))
    del out["/gnss/rover/fix"]
    solution = out[f"/solution/{run}"]
    status = np.full(len(solution), solution_pb2.SOLUTION_STATUS_PREDICTED, dtype=np.int32)
    status[::10] = solution_pb2.SOLUTION_STATUS_FIXED
    values = {**solution.values, "status": status}
    if single:
        away = np.array([0.1, -0.2, 0.3])
        values["position_ecef_m"] = values["position_ecef_m"] + away @ _ecef_origin()[1]
    out[f"/solution/{run}"] = Columns.build(solution.valid_time_ns, values)
    for name in (*STATIONS, "rover"):
        out |= _receiver(world, name)
    out |= _integers(world, run)
    if not single:
        for baseline in BASELINES:
            out |= _baseline(world, baseline)
        out["/network/rover/corrections"] = _corrections(world)
    return out


def _table(world: _World, values: dict[str, list[np.ndarray]], rows: list[tuple]) -> Columns:
    """Rows (epochs, satellite, reference, signal) with their values, in the order of time."""
    times = np.concatenate([ns(world.t[at]) for at, *_ in rows])
    names = {
        field: np.concatenate([np.broadcast_to(row[i], len(row[0])) for row in rows])
        for i, field in ((1, "satellite"), (2, "reference"), (3, "signal"))
    }
    order = np.lexsort((names["signal"], names["satellite"], times))
    columns: dict = {
        field: Ragged.from_texts(text[order].tolist())
        for field, text in names.items()
        if not (field == "reference" and (text == "").all())
    }
    columns |= {field: np.concatenate(parts)[order] for field, parts in values.items()}
    present = {}
    if "integer_cycles" in columns:
        present["integer_cycles"] = np.isfinite(columns["integer_cycles"])
    for field in ("carrier_phase_cycles", "pseudorange_m"):
        if field in columns:
            present[field] = np.ones(len(times), dtype=bool)
    if np.isnan(columns.get("shapiro_m", 0.0)).any():
        present["shapiro_m"] = np.zeros(len(times), dtype=bool)
    return Columns.build(times[order], columns, present=present)


def _receiver(world: _World, name: str) -> dict[str, Columns]:
    n = len(world.t)
    rows: list[tuple] = []
    truth: dict[str, list[np.ndarray]] = {}
    observed: dict[str, list[np.ndarray]] = {}
    modelled: dict[str, list[np.ndarray]] = {}
    for s, satellite in enumerate(SATELLITES):
        for signal in SIGNALS:
            rows.append((np.arange(n), satellite, "", signal))
            length = wavelength_m("G", int(signal[0]))
            parts = {
                "range_m": 2.1e7 + 1e5 * s + 300.0 * world.t + 7.0 * len(name),
                "satellite_clock_m": np.full(n, 3e4 + s),
                "receiver_clock_m": np.full(n, 1e3 * len(name)),
                "ionosphere_m": 5.0 * _FACTOR[signal] - world.error(name, satellite, signal),
                "troposphere_m": np.full(n, 2.4 + 0.1 * s),
                "shapiro_m": np.zeros(n),
                "orbit_error_m": np.full(n, 0.3 * s),
                "code_delay_m": np.zeros(n),
                "code_multipath_m": np.zeros(n),
                "carrier_multipath_m": np.zeros(n),
                "code_noise_m": np.zeros(n),
                "carrier_noise_m": np.zeros(n),
                "ambiguity_cycles": np.full(n, world.cycles[name, satellite, signal]),
            }
            phase = (
                parts["range_m"] - parts["satellite_clock_m"] + parts["receiver_clock_m"]
                - parts["ionosphere_m"] + parts["troposphere_m"]
            )  # fmt: skip
            _put(truth, parts)
            _put(
                observed,
                {
                    "pseudorange_m": phase + 2.0 * parts["ionosphere_m"],
                    "carrier_phase_cycles": phase / length + parts["ambiguity_cycles"],
                },
            )
            _put(
                modelled,
                {
                    "ionosphere_m": np.full(n, 5.0 * _FACTOR[signal]),
                    "hydrostatic_m": np.full(n, 2.3),
                    "wet_m": np.full(n, 0.1 + 0.1 * s),
                    "shapiro_m": np.full(n, np.nan),
                    **{
                        field: np.zeros(n)
                        for field in (
                            "distance_m", "sagnac_m", "satellite_clock_m", "relativity_m",
                            "group_delay_m", "hydrostatic_mapping", "wet_mapping",
                        )
                    },
                },
            )  # fmt: skip
    out = {
        f"/truth/{name}/signals": _table(world, truth, rows),
        f"/gnss/{name}/obs": _table(world, observed, rows),
        f"/gnss/{name}/corrections": _table(world, modelled, rows),
    }
    if name in STATIONS:
        origin, axes = _ecef_origin()
        place = origin + np.array([*STATIONS[name], 0.0]) @ axes
        out[f"/gnss/{name}/receiver"] = Columns.build(
            ns(world.t[:1]),
            {
                **{
                    field: Ragged.from_texts([name])
                    for field in ("receiver", "antenna", "header", "marker")
                },
                "approximate_position_ecef_m": place[np.newaxis],
            },
            present={"approximate_position_ecef_m": np.ones(1, dtype=bool)},
        )
    return out


def _put(into: dict[str, list[np.ndarray]], parts: dict[str, np.ndarray]) -> None:
    for field, values in parts.items():
        into.setdefault(field, []).append(values)


def _ambiguity_rows(
    world: _World, station: str, master: str, signals: tuple[str, ...], fixed: np.ndarray,
    ref: np.ndarray,
) -> tuple[dict[str, list[np.ndarray]], list[tuple]]:  # fmt: skip
    rows: list[tuple] = []
    values: dict[str, list[np.ndarray]] = {}
    for satellite in SATELLITES:
        at = np.flatnonzero(ref != satellite)
        for signal in signals:
            whole = np.array(
                [world.integer(station, master, satellite, r, signal) for r in ref[at]], dtype=float
            )
            rows.append((at, satellite, ref[at], signal))
            _put(
                values,
                {
                    "float_cycles": whole + 0.03,
                    "float_std_cycles": np.full(len(at), 0.05),
                    "integer_cycles": np.where(fixed[at], whole, np.nan),
                    "status": np.where(fixed[at], FIXED, FLOAT).astype(np.int32),
                },
            )
    return values, rows


def _integers(world: _World, run: str) -> dict[str, Columns]:
    n = len(world.t)
    late = np.arange(n) >= n - PLANTED["tried"]
    refused = np.zeros(n, dtype=bool)
    refused[n - PLANTED["tried"] :][: PLANTED["refused"]] = True
    values, rows = _ambiguity_rows(world, "rover", "mref", SIGNALS, ~refused, world.reference())
    wrong = np.flatnonzero(late & ~refused)[-PLANTED["wrong"] :]
    at = rows[0][0]
    values["integer_cycles"][0] = values["integer_cycles"][0] + np.isin(at, wrong)
    count = 2 * (len(SATELLITES) - 1)
    resolution = Columns.build(
        ns(world.t),
        {
            "candidate_count": np.full(n, count, dtype=np.uint32),
            "fixed_count": np.where(refused, 0, count).astype(np.uint32),
            "ratio": np.where(refused, 1.2, 9.0),
            "w_ratio": np.where(refused, 1.0, 20.0),
            "threshold": np.full(n, 3.0),
            "success_rate": np.full(n, 0.9999),
            "status": np.where(refused, 3, FIXED).astype(np.int32),
        },
    )
    return {
        f"/filter/{run}/ambiguities": _table(world, values, rows),
        f"/filter/{run}/resolution": resolution,
    }


def _baseline(world: _World, baseline: str) -> dict[str, Columns]:
    master, _, station = baseline.partition("-")
    ref = world.reference(baseline)
    fixed = world.t - world.t[0] >= CONVERGED_S
    values, rows = _ambiguity_rows(world, station, master, (*SIGNALS, "WL"), fixed, ref)
    if baseline == "ref1-ref2":
        place = next(i for i, row in enumerate(rows) if row[1] == "G20" and row[3] == "1C")
        values["integer_cycles"][place][-PLANTED["closure"] :] += 1.0
    topic = f"/network/{baseline}"
    found: dict[str, list[np.ndarray]] = {}
    filtered: dict[str, list[np.ndarray]] = {}
    phases: list[tuple] = []
    rng = np.random.default_rng(len(baseline) + ord(baseline[-1]))
    for satellite in SATELLITES:
        at = np.flatnonzero(ref != satellite)
        for signal in SIGNALS:
            error = world.difference(station, master, satellite, ref, signal)[at]
            noise = 0.006 * rng.standard_normal(len(at))
            settle = np.exp(-np.arange(len(at)) / 20.0)
            phases.append((at, satellite, ref[at], signal))
            _put(
                found,
                {"residual_m": error + noise, "residual_std_m": np.full(len(at), 0.006)},
            )
            _put(
                filtered,
                {
                    "error_m": error,
                    "error_rate_m_s": 1e-4 * settle,
                    "error_acceleration_m_s2": 1e-7 * settle,
                    "multipath_m": 0.3 * noise,
                    "error_std_m": 0.004 + 0.05 * settle,
                    "error_rate_std_m_s": 1e-5 + 1e-3 * settle,
                    "error_acceleration_std_m_s2": 1e-7 + 1e-6 * settle,
                    "multipath_std_m": 0.004 + 0.002 * settle,
                    "innovation_m": noise,
                    "innovation_std_m": np.full(len(at), 0.007),
                },
            )
    return {
        f"{topic}/ambiguities": _table(world, values, rows),
        f"{topic}/residuals": _table(world, found, phases),
        f"{topic}/errors": _table(world, filtered, phases),
    }


def _corrections(world: _World) -> Columns:
    ref = world.reference()
    n = len(world.t)
    rows: list[tuple] = []
    values: dict[str, list[np.ndarray]] = {}
    for satellite in SATELLITES:
        for signal in SIGNALS:
            rows.append((np.arange(n), satellite, ref, signal))
            away = world.difference("rover", "mref", satellite, ref, signal)
            own = ref == satellite
            _put(
                values,
                {
                    "correction_m": np.where(own, 0.0, away - LEFT_M),
                    "correction_std_m": np.where(own, 0.0, 0.005),
                    "misfit_m": np.zeros(n),
                    "station_count": np.full(n, 3, dtype=np.uint32),
                    "age_s": np.zeros(n),
                },
            )
    return _table(world, values, rows)


def make_metadata(run: str = "network") -> dict[str, dict[str, str]]:
    """Of a log whose run was configured with the master of this network."""
    import json

    configuration = f'name = "{run}"\n[gnss]\nreceiver = "rover"\nbase = "mref"\n'
    manifest = {"pipeline": "network-ins-tc", "configuration": configuration}
    return {"replay.manifest": {"json": json.dumps(manifest)}}
