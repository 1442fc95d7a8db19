"""A made-up sky over one receiver, of which everything is known."""

from __future__ import annotations

import dataclasses

import numpy as np

from replay.kernels import ppp, ppp_output, ppp_records, rtk_records, single_records
from replay.kernels.gnss_records import EPOCH_DTYPE, MEASURED_DTYPE, SATELLITES, SLOTS, SYSTEMS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.stages.state_names import name_of
from replay.stages.transitions import Recorder

C_M_S = 299792458.0
NS = 1_000_000_000
L1 = 1575.42e6
FREQUENCY = {
    0: (1575.42e6, 1227.60e6, 1176.45e6),
    1: (1602.0e6, 1246.0e6, 1202.025e6),
    2: (1575.42e6, 1176.45e6, 1207.14e6),
}
FIRST = {0: 0, 1: 32, 2: 64}
PLACE = np.array([3582105.0, 532590.0, 5232755.0])
T0 = 1_277_000_000 * NS


def local_axes(place):
    up = place / np.linalg.norm(place)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return np.stack([east, np.cross(up, east), up])


@dataclasses.dataclass
class Sky:
    """Truth of a receiver and its satellites."""

    systems: tuple[int, ...] = (0, 2)
    each: int = 8
    slots: int = 2
    interval: float = 30.0
    seed: int = 1
    clock: object = lambda t: 30.0 + 0.1 * t
    between: tuple[float, ...] = (0.0, 5.0, -7.0, 0.0, 0.0)
    wet: float = 0.05
    gradient: tuple[float, float] = (0.0, 0.0)
    code_bias: float = 0.0
    slant: object = lambda sat, t: 3.0 + 0.05 * (sat % 7) + 1e-4 * t
    code_noise: float = 0.0
    phase_noise: float = 0.0
    place: object = lambda t: PLACE

    def __post_init__(self):
        generator = np.random.default_rng(self.seed)
        self.generator = np.random.default_rng(self.seed + 1000)
        self.satellites = [(s, p) for s in self.systems for p in range(self.each)]
        count = len(self.satellites)
        spread = np.arange(count) * 2.399963
        self.azimuth0 = np.mod(spread, 2 * np.pi)
        self.elevation0 = np.linspace(0.25, 1.4, count)[generator.permutation(count)]
        self.turn = generator.uniform(-1.0, 1.0, (count, 2)) * 1e-4
        self.cycles = generator.integers(-500, 500, (count, SLOTS))

    def direction(self, k, t):
        elevation = np.clip(self.elevation0[k] + self.turn[k, 0] * t, 0.17, 1.5)
        azimuth = np.mod(self.azimuth0[k] + self.turn[k, 1] * t, 2 * np.pi)
        return elevation, azimuth

    def wavelength(self, k, slot):
        return C_M_S / FREQUENCY[self.satellites[k][0]][slot]

    def epochs(self, numbers, skip=lambda k, e: False, slips=None, code_error=None):
        """Records of epochs; `slips` and `code_error` take (satellite, epoch, slot)."""
        axes = local_axes(PLACE)
        epochs = np.zeros(len(numbers), dtype=EPOCH_DTYPE)
        rows = []
        for place, e in enumerate(numbers):
            t = e * self.interval
            position = np.asarray(self.place(t), dtype=float)
            epoch = epochs[place]
            epoch["t"] = T0 + round((t + self.clock(t) / C_M_S) * NS)
            epoch["log_t"] = epoch["t"]
            epoch["first"] = len(rows)
            epoch["placed"] = 1
            epoch["x"] = position + [1.5, -1.0, 0.8]
            epoch["clock"] = self.clock(t) + 3.0
            for k, (system, prn) in enumerate(self.satellites):
                if skip(k, e):
                    continue
                elevation, azimuth = self.direction(k, t)
                local = [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth)]
                line = np.array([*local, np.sin(elevation)]) @ axes
                row = np.zeros((), dtype=MEASURED_DTYPE)
                row["satellite"] = FIRST[system] + prn
                row["system"] = system
                row["prn"] = prn + 1
                row["signal"] = 0
                row["cn0"] = 45.0
                row["lock_time"] = np.nan
                for name in ("code", "phase", "range_rate", "frequency"):
                    row[name] = np.nan
                row["seen"] = 1
                row["position"] = position + 22e6 * line
                row["elevation"] = elevation
                row["azimuth"] = azimuth
                wet = 1.0 / np.sin(elevation)
                row["wet_mapping"] = wet
                row["hydrostatic_mapping"] = wet
                m = 1.0 / (np.sin(elevation) * np.tan(elevation) + 0.0032)
                distance = np.linalg.norm(row["position"] - position)
                shared = distance + self.clock(t) + self.between[system] + self.wet * wet
                shared += m * (
                    self.gradient[0] * np.cos(azimuth) + self.gradient[1] * np.sin(azimuth)
                )
                factor = np.sqrt(0.5 * (1.0 + 1.0 / np.sin(elevation) ** 2))
                for slot in range(self.slots):
                    f = FREQUENCY[system][slot]
                    row["signal"][slot] = 49 + 256 * (67 + slot)
                    row["frequency"][slot] = f
                    delay = (L1 / f) ** 2 * self.slant(row["satellite"], t)
                    noise = self.generator.normal(size=2) * factor
                    code = shared + delay + self.code_noise * noise[0]
                    if slot > 0:
                        code += self.code_bias
                    phase = shared - delay + self.phase_noise * noise[1]
                    cycles = self.cycles[k, slot]
                    if slips is not None:
                        cycles = cycles + slips(k, e, slot)
                    if code_error is not None:
                        code += code_error(k, e, slot)
                    row["code"][slot] = code
                    row["phase"][slot] = phase + self.wavelength(k, slot) * cycles
                    row["phase_known"][slot] = 1
                rows.append(row)
            epoch["count"] = len(rows) - epoch["first"]
        return epochs, np.array(rows, dtype=MEASURED_DTYPE)


def settings(**changes):
    """Settings that say little: priors wide, no process noise."""
    record = np.zeros(1, dtype=ppp_records.PPP_CONFIG_DTYPE)
    values = {
        "mask": 0.1, "slots": 2, "weighting": 5, "code_sigma": 0.5, "phase_sigma": 0.003,
        "doppler_sigma": 0.05, "code_scale": 1.0, "phase_scale": 1.0, "satellite_scale": 1.0,
        "code_gate": 1e9, "phase_gate": 1e9, "rounds": 24, "dynamics": ppp_records.STATIC,
        "position_sigma": 100.0, "velocity_sigma": 10.0, "clock_sigma": 100.0, "wet_sigma": 0.3,
        "bias_sigma": 20.0, "ionosphere_sigma": 100.0, "ionosphere_noise": -1.0,
        "ambiguity_sigma": 300.0, "gap": 100.0, "geometry_free": 0.05,
        "geometry_free_rate": 1e-3, "wide_lane": 3.0, "rejections": 2, "failures": 3,
        "mode": ppp_records.FLOAT_ONLY, "threshold": 3.0, "success": 0.99, "least": 4,
        "apart": 0.5, "proven": 10, "confirm": 3, "partial": 2, "drops": 3, "hold_count": 3,
        "hold_sigma": 0.03, "constraint_sigma": 0.5,
    }  # fmt: skip
    for name, value in {**values, **changes}.items():
        record[name] = value
    return record


@dataclasses.dataclass
class Result:
    """What the filter wrote, and what it keeps."""

    state: np.ndarray
    x: np.ndarray
    P: np.ndarray
    solutions: np.ndarray
    innovations: np.ndarray
    ambiguities: np.ndarray
    resolutions: np.ndarray
    notes: np.ndarray
    zeniths: np.ndarray
    slants: np.ndarray
    biases: np.ndarray
    phases: np.ndarray


def new_recorder(on=True):
    """What keeps the nodes of a run for a smoother."""
    return Recorder(ppp_records.ROOM, on, name_of())


def run(config, epochs, rows, state=None, recorder=None):
    """Run the filter over epochs; `state` is that of a run before.

    A recorder that is on keeps its nodes.
    """
    recorder = new_recorder(on=False) if recorder is None else recorder
    n = len(rows)
    if state is None:
        state = (
            ppp_records.new_ppp_state(), np.zeros(ppp_records.ROOM),
            np.zeros((ppp_records.ROOM, ppp_records.ROOM)),
        )  # fmt: skip
    kernel, x, P = state

    def call(nodes):
        outs = [
            np.zeros(len(epochs), dtype=single_records.SINGLE_ROW_DTYPE),
            np.zeros(8 * n, dtype=single_records.RESIDUAL_DTYPE),
            np.zeros(3 * n, dtype=rtk_records.AMBIGUITY_ROW_DTYPE),
            np.zeros(len(epochs), dtype=rtk_records.RESOLUTION_ROW_DTYPE),
            np.zeros(300 * len(epochs), dtype=NOTE_DTYPE),
            np.zeros(len(epochs), dtype=ppp_records.ZENITH_ROW_DTYPE),
            np.zeros(n, dtype=ppp_records.SLANT_ROW_DTYPE),
            np.zeros(SYSTEMS * SLOTS * len(epochs), dtype=ppp_records.BIAS_ROW_DTYPE),
            np.zeros(3 * n, dtype=ppp_records.PHASE_ROW_DTYPE),
        ]
        counts = np.zeros(ppp_output.COUNTS, dtype=np.int64)
        ppp.run_ppp(
            kernel, x, P, config, np.zeros(1, dtype=SOLVE_DTYPE), epochs, rows, *outs, counts,
            recorder.trail, nodes,
        )  # fmt: skip
        return outs, counts

    outs, counts = recorder.run(call, kernel, x, P, recorder.trail)
    places = (0, 2, 3, 4, 5, 6, 7, 8, 9)
    return Result(kernel, x, P, *(out[: counts[k]] for out, k in zip(outs, places, strict=True)))


assert SATELLITES >= 104
