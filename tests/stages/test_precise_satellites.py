"""Precise products: gaps, ends and frames are told, no cut of the log changes a byte."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from replay import channels
from replay.errors import ConfigurationError, MissingChannelError
from replay.gnss.measurements import gather_epochs, select_signals
from replay.log.columns import Ragged, concatenate
from replay.schemas import filter_pb2
from replay.stages.base import Context
from replay.stages.precise_satellites import PreciseSatellites
from replay.stages.satellites import config_record
from replay.view.events import events_of
from tests.engine.drives import content, cut
from tests.stages.gnss_chain import (
    COARSE,
    CORRECTIONS,
    OBS,
    PROBLEMS,
    SATELLITES,
    keyed,
    spp_config,
)
from tests.stages.precise_logs import SIGNALS, folder_of, precise, precise_config, station_log

SECOND = 1_000_000_000
ORBIT, CLOCK, BIAS, FILES = (
    channel.name
    for channel in (
        channels.PRECISE_ORBIT,
        channels.PRECISE_CLOCK,
        channels.SIGNAL_BIAS,
        channels.PRODUCTS,
    )
)


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    """An hour of CCJ2, every fourth epoch."""
    folder_of("ccj2")
    inputs = station_log("ccj2", tmp_path_factory.mktemp("ccj2"))
    times = inputs[OBS].valid_time_ns
    keep = np.isin(times, np.unique(times)[::4])
    return {**inputs, OBS: inputs[OBS].take(keep)}


def blocks(inputs, config, edges, dump_at=None):
    """Outputs of the stage in blocks, as bytes; it goes through a dump after one of them."""
    stage = PreciseSatellites()
    state = stage.start(config, Context({}, {}))
    parts = {}
    for number, block in enumerate(cut(inputs, edges)):
        if number == dump_at:
            dumped = stage.dump(state)
            state = stage.restore(stage.start(config, Context({}, {})), dumped)
            assert stage.dump(state) == dumped
        state, outputs = stage.step(state, block)
        for name, rows in outputs.items():
            parts.setdefault(name, []).append(rows)
    return {name: content(name, concatenate(rows)) for name, rows in parts.items()}


def details(outputs):
    """Texts of all events."""
    return outputs[PROBLEMS].ragged("detail").texts() if PROBLEMS in outputs else []


def edges_of(inputs):
    return np.unique(inputs[OBS].log_time_ns)[[0, 3, 4, 17]].tolist()


def test_how_the_log_is_cut_changes_no_byte(station):
    config = precise_config("ccj2", {"terms": {"higher_ionosphere": True}})
    whole = blocks(station, config, [])
    assert set(whole) == {SATELLITES, CORRECTIONS, COARSE, PROBLEMS}
    assert blocks(station, config, edges_of(station), dump_at=2) == whole


def test_an_epoch_does_not_know_a_product_of_later(station):
    """Clocks that come half way: epochs before are as if there were none, however it is cut."""
    config = precise_config("ccj2")
    times = np.unique(station[OBS].log_time_ns)
    late = int(times[len(times) // 2])
    clocks, orbits = station[CLOCK], station[ORBIT]
    orbits = dataclasses.replace(
        orbits, present={**orbits.present, "clock_s": np.zeros(len(orbits), dtype=np.bool_)}
    )
    moved = dataclasses.replace(clocks, log_time_ns=np.full(len(clocks), late, dtype=np.int64))
    inputs = {**station, CLOCK: moved, ORBIT: orbits}
    found = precise(inputs, config)
    assert found[SATELLITES].valid_time_ns.min() == late
    assert blocks(inputs, config, edges_of(inputs), dump_at=1) == blocks(inputs, config, [])


def test_a_range_less_its_terms_is_one_clock_per_system(station):
    """Ionosphere-free codes, positions and clocks of each epoch: what is left is code noise."""
    left = {}
    for biases in (True, False):
        found = precise(station, precise_config("ccj2", {"products": {"biases": biases}}))
        left[biases] = code_residuals(station[OBS], found)
    assert len(left[True]) > 300
    assert np.sqrt(np.mean(left[True] ** 2)) < 1.2
    assert np.abs(left[True]).max() < 8.0
    # The codes observed are not those that the clocks refer to.
    assert np.mean(left[True] ** 2) < 0.85 * np.mean(left[False] ** 2)


def code_residuals(observations, found):
    """Residuals (m) of ionosphere-free codes above 10 degrees."""
    selection = select_signals(SIGNALS["ccj2"], "GRE")
    joined = gather_epochs(
        observations, selection, found[SATELLITES], found[CORRECTIONS], found[COARSE]
    )
    left = []
    for epoch in joined.epochs:
        rows = joined.rows[epoch["first"] : epoch["first"] + epoch["count"]]
        rows = rows[(rows["seen"] == 1) & (rows["elevation"] > np.radians(10.0))]
        rows = rows[np.isfinite(rows["code"][:, :2]).all(axis=1)]
        if len(rows) < 9:
            continue
        plain = rows["code"][:, :2] - rows["group_delay"][:, :2]
        plain += (rows["clock"] - rows["hydrostatic"] - rows["wet"] - rows["shapiro"])[:, None]
        f1, f2 = rows["frequency"][:, 0] ** 2, rows["frequency"][:, 1] ** 2
        ranges = (f1 * plain[:, 0] - f2 * plain[:, 1]) / (f1 - f2)
        systems = (rows["system"][:, None] == np.unique(rows["system"])).astype(float)
        x = epoch["x"].copy()
        weight = np.sin(rows["elevation"])[:, None]
        for _ in range(4):
            away = rows["position"] - x
            distance = np.linalg.norm(away, axis=1)
            design = np.hstack([-away / distance[:, None], systems])
            rest = ranges - distance
            solved = np.linalg.lstsq(design * weight, rest * weight[:, 0], rcond=None)[0]
            x += solved[:3]
        left.append(rest - design @ solved)
    return np.concatenate(left)


def test_a_satellite_without_products_is_told_once(station):
    keep = station[ORBIT]["satellite"] != b"G08"
    inputs = {**station, ORBIT: station[ORBIT].take(np.flatnonzero(keep))}
    found = precise(inputs, precise_config("ccj2"))
    assert b"G08" not in found[SATELLITES]["satellite"].tolist()
    assert details(found).count("G08: the products have no orbit of it") == 1
    assert "G08: the products have no orbit of it" not in details(
        precise(station, precise_config("ccj2"))
    )


def between(columns, low_ns, high_ns):
    times = columns.valid_time_ns
    return columns.take(np.flatnonzero((times >= low_ns) & (times <= high_ns)))


def test_the_end_of_products_is_told_and_weighed(station):
    """Orbits of five minutes: one step past their end they are continued, then they are not."""
    config = precise_config("ccj2")
    first, last = (int(f(station[OBS].valid_time_ns)) for f in (np.min, np.max))
    end = first + 3000 * SECOND
    coarser = station[ORBIT].take(
        np.flatnonzero((station[ORBIT].valid_time_ns - first) % (300 * SECOND) == 0)
    )
    whole = precise(station, config)
    short = precise({**station, ORBIT: between(coarser, 0, end)}, config)
    sights = short[SATELLITES]
    assert sights.valid_time_ns.max() == end + 240 * SECOND < last
    assert any("its orbit begins later or ended before" in text for text in details(short))
    told = details(short)
    seen = set(sights["satellite"][sights.valid_time_ns > end + SECOND].tolist())
    for name in seen:
        text = f"{name.decode()}: its orbit is continued past the epochs of the products"
        assert told.count(text) == 1
    late = sights.valid_time_ns > end + SECOND
    true = dict(
        zip(
            zip(
                whole[SATELLITES].valid_time_ns.tolist(),
                whole[SATELLITES]["satellite"].tolist(),
                strict=True,
            ),
            whole[SATELLITES]["position_ecef_m"],
            strict=True,
        )
    )
    keys = zip(sights.valid_time_ns.tolist(), sights["satellite"].tolist(), strict=True)
    wrong = np.array(
        [
            np.linalg.norm(place - true[key])
            for key, place in zip(keys, sights["position_ecef_m"], strict=True)
        ]
    )
    assert wrong[~late].max() < 5e-2
    # The deviation that is stated grows with the error.
    assert np.mean(wrong[late] < 3.0 * sights["range_std_m"][late]) > 0.95
    assert sights["range_std_m"][late].max() > 2.0 * sights["range_std_m"][~late].max()


def test_a_gap_of_clocks_is_told(station):
    config = precise_config("ccj2")
    first = int(station[OBS].valid_time_ns.min())
    clocks = station[CLOCK]
    times = clocks.valid_time_ns
    inside = (times > first + 900 * SECOND) & (times < first + 1500 * SECOND)
    gone = inside & (clocks["satellite"] == b"G08") & clocks.is_present("satellite")
    found = precise({**station, CLOCK: clocks.take(np.flatnonzero(~gone))}, config)
    assert details(found).count("G08: in a gap of its clock") == 1
    sights = found[SATELLITES]
    own = sights.valid_time_ns[sights["satellite"] == b"G08"]
    assert not ((own > first + 961 * SECOND) & (own < first + 1439 * SECOND)).any()
    assert (own > first + 1500 * SECOND).any()


def test_frames_that_differ_are_named(station):
    files = station[FILES]
    frames = ["IGS14", "IGb14", "", ""]
    values = {**files.values, "frame": Ragged.from_texts(frames)}
    mixed = {**station, FILES: dataclasses.replace(files, values=values, payloads=None)}
    told = [text for text in details(precise(mixed, precise_config("ccj2"))) if "frames" in text]
    assert len(told) == 1
    assert "IGS14" in told[0]
    assert "IGb14" in told[0]
    assert not any("frames" in text for text in details(precise(station, precise_config("ccj2"))))


def test_terms_that_the_log_cannot_give_are_absent(station):
    lean = {name: rows for name, rows in station.items() if name in (OBS, ORBIT, CLOCK)}
    told = precise(lean, precise_config("ccj2"))[CORRECTIONS]
    for name in ("satellite_antenna_m", "antenna_m", "pole_tide_m", "ocean_loading_m",
                 "phase_bias_m", "higher_ionosphere_m"):  # fmt: skip
        assert not told.is_present(name).any(), name
    assert told.is_present("solid_tide_m").all()
    assert told.is_present("wind_up_m").all()
    assert not told["group_delay_m"].any()


def test_biases_are_those_of_the_file(station):
    """Metres of the value for the observation, added to what is measured."""
    biases = station[BIAS]
    names = biases.ragged("observation").texts()
    value = {
        (satellite, name): float(seconds) * 299792458.0
        for satellite, name, seconds in zip(
            biases["satellite"].tolist(), names, biases["value_s"], strict=True
        )
    }
    told = precise(station, precise_config("ccj2"))[CORRECTIONS]
    known = told.is_present("phase_bias_m")
    assert known.any()
    for k in range(len(told)):
        satellite, signal = told["satellite"][k], told["signal"][k].decode()
        code = value.get((satellite, "C" + signal), 0.0)
        assert told["group_delay_m"][k] == pytest.approx(code, abs=1e-9)
        assert known[k] == ((satellite, "L" + signal) in value)
        if known[k]:
            phase = value[satellite, "L" + signal]
            assert told["phase_bias_m"][k] == pytest.approx(phase, abs=1e-9)


def test_wind_up_is_a_length_of_the_same_cycles(station):
    told = precise(station, precise_config("ccj2"))[CORRECTIONS]
    wind_up = keyed(told, "wind_up_m")
    pairs = [
        (value, wind_up[t, satellite, b"2W"])
        for (t, satellite, signal), value in wind_up.items()
        if signal == b"1C" and satellite[:1] == b"G" and (t, satellite, b"2W") in wind_up
    ]
    first, second = np.array(pairs).T
    np.testing.assert_allclose(first * 1575.42, second * 1227.60, rtol=1e-12)


def test_a_map_needs_a_precise_pipeline_and_a_log_with_maps():
    with pytest.raises(ConfigurationError, match="precise"):
        config_record(spp_config({"atmosphere": {"ionosphere": "map"}}))
    config = precise_config("ccj2", {"atmosphere": {"ionosphere": "map"}})
    topics = {channels.PRECISE_ORBIT.name: channels.PRECISE_ORBIT.topic}
    with pytest.raises(MissingChannelError, match="ionosphere_map"):
        PreciseSatellites().start(config, Context(topics, {}))
    with pytest.raises(MissingChannelError, match="orbit"):
        PreciseSatellites().start(precise_config("ccj2"), Context({OBS: "/gnss/a/obs"}, {}))


def test_events_say_what_of_the_products_lacks(station):
    """Each kind of its own, so that a page and a recording name it."""
    first = int(station[OBS].valid_time_ns.min())
    files = station[FILES]
    values = {**files.values, "frame": Ragged.from_texts(["IGS14", "ITRF2020", "", ""])}
    orbits = station[ORBIT]
    coarser = orbits.take(
        np.flatnonzero(
            ((orbits.valid_time_ns - first) % (300 * SECOND) == 0) & (orbits["satellite"] != b"G08")
        )
    )
    inputs = {
        **station,
        FILES: dataclasses.replace(files, values=values, payloads=None),
        ORBIT: between(coarser, 0, first + 3000 * SECOND),
        BIAS: station[BIAS].take(np.flatnonzero(station[BIAS]["satellite"] != b"G27")),
    }
    events = precise(inputs, precise_config("ccj2"))[PROBLEMS]
    kinds = {
        kind: {text for text, own in zip(details({PROBLEMS: events}), events["kind"], strict=True)
               if own == filter_pb2.EventKind.Value(f"EVENT_KIND_{kind}")}
        for kind in ("NO_EPHEMERIS", "PRODUCT_LACKING", "PRODUCT_CONTINUED", "FRAMES_DIFFER")
    }  # fmt: skip
    assert "G08: the products have no orbit of it" in kinds["NO_EPHEMERIS"]
    assert {"G27: the products have no bias of C1C"} <= kinds["PRODUCT_LACKING"]
    assert all("past the epochs of the products" in text for text in kinds["PRODUCT_CONTINUED"])
    assert kinds["PRODUCT_CONTINUED"]
    (frames,) = kinds["FRAMES_DIFFER"]
    assert "IGS14 and ITRF2020" in frames
    assert sum(len(texts) for texts in kinds.values()) <= len(events)
    # In words, as a page and a recording show them.
    shown = events_of(events)
    assert not any(event.kind.startswith("unknown") for event in shown)
    assert {event.level for event in shown if "frames" in event.detail} == {"ERROR"}
