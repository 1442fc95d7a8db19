"""The stage of the errors between two stations: its channels, its settings, cuts of the log."""

import numpy as np
import pytest

from replay import channels, configuration
from replay.errors import ConfigurationError
from replay.log.columns import Columns, concatenate
from replay.stages.base import Context, Port
from replay.stages.baseline_errors import BaselineErrors, multipath_share
from replay.stages.network_config import NetworkConfig, NetworkInsConfig, NetworkRtkConfig
from tests.stages.gnss_chain import logged
from tests.stages.two_receivers import NS, run_stage

BASELINE = "mref-ref1"
RESIDUALS = Port(channels.NETWORK_RESIDUALS, BASELINE).name
ERRORS = Port(channels.NETWORK_ERRORS, BASELINE).name
T0 = 1_300_000_000 * NS
# In the order of satellites, which is not that of the alphabet; one of each system is the
# reference, which another one takes over.
NAMES = (b"G03", b"G11", b"G24", b"G30", b"R05", b"R07", b"E02", b"E19", b"C06", b"C33")
SIGNALS = {b"G": (b"1C", b"2W"), b"R": (b"1C", b"2C"), b"E": (b"1C", b"5Q"), b"C": (b"2I", b"7I")}


def config(cls=NetworkConfig, **tables):
    return configuration.build(cls, [tables])


def residuals(epochs=40, seed=1):
    """Residuals of all systems whose reference changes at the 20th epoch; satellites come late."""
    rng = np.random.default_rng(seed)
    level = dict(zip(NAMES, rng.normal(0.0, 0.1, len(NAMES)), strict=True))
    rows = []
    for k in range(epochs):
        for name in NAMES:
            own = [other for other in NAMES if other[:1] == name[:1]]
            reference = own[0] if k < 20 else own[1]
            if name == reference or rng.uniform() < 0.1:
                continue
            for signal in SIGNALS[name[:1]]:
                z = level[name] - level[reference] + 0.005 * rng.normal() + 1e-4 * k
                rows.append((T0 + k * NS, name, reference, signal, z, rng.uniform(0.008, 0.02)))
    t, satellite, reference, signal, z, sigma = zip(*rows, strict=True)
    valid = np.array(t, dtype=np.int64)
    return Columns.build(
        valid,
        {
            "satellite": np.array(satellite, dtype="S3"),
            "reference": np.array(reference, dtype="S3"),
            "signal": np.array(signal, dtype="S2"),
            "residual_m": np.array(z),
            "residual_std_m": np.array(sigma),
        },
        log_time_ns=valid + 250_000_000,
    )


def errors(parts):
    """All rows that were written."""
    return concatenate([part[ERRORS] for part in parts if ERRORS in part])


def assert_same(a, b):
    np.testing.assert_array_equal(a.valid_time_ns, b.valid_time_ns)
    np.testing.assert_array_equal(a.log_time_ns, b.log_time_ns)
    assert a.values.keys() == b.values.keys()
    for name, column in a.values.items():
        assert column.tobytes() == b.values[name].tobytes(), name


def test_rows_bear_the_names_and_times_of_their_residuals():
    rows = residuals()
    out = errors(run_stage(BaselineErrors(BASELINE), config(), [{RESIDUALS: rows}]))
    np.testing.assert_array_equal(out.valid_time_ns, rows.valid_time_ns)
    np.testing.assert_array_equal(out.log_time_ns, rows.log_time_ns)
    for name in ("satellite", "reference", "signal"):
        np.testing.assert_array_equal(out[name], rows[name])
    late = rows.valid_time_ns >= T0 + 15 * NS
    assert np.abs(out["error_m"] - rows["residual_m"])[late].max() < 0.03
    # A change of reference lets no filter begin anew.
    known = np.isfinite(out["innovation_m"])
    assert known[late].all()
    # One beginning for each but the first references, which the second ones bring along.
    assert (~known).sum() == 2 * (len(NAMES) - len(SIGNALS))


def test_cutting_the_log_changes_no_bit():
    rows = residuals()
    stage, settings = BaselineErrors(BASELINE), config()
    one = errors(run_stage(stage, settings, [{RESIDUALS: rows}]))
    state = stage.start(settings, Context({}, {}))
    many = []
    for t in np.unique(rows.log_time_ns):
        state = stage.restore(stage.start(settings, Context({}, {})), stage.dump(state))
        piece = rows.take(rows.log_time_ns == t)
        state, outputs = stage.step(state, {RESIDUALS: piece})
        many.append(outputs)
    many.append(stage.finish(state))
    assert_same(one, errors(many))
    whole_state = stage.start(settings, Context({}, {}))
    whole_state, _ = stage.step(whole_state, {RESIDUALS: rows})
    assert stage.dump(whole_state) == stage.dump(state)


def test_the_order_of_rows_of_one_log_time_does_not_matter():
    rows = residuals(12)
    rng = np.random.default_rng(2)
    order = np.lexsort((rng.uniform(size=len(rows)), rows.log_time_ns))
    stage = BaselineErrors(BASELINE)
    a = errors(run_stage(stage, config(), [{RESIDUALS: rows}]))
    b = errors(run_stage(stage, config(), [{RESIDUALS: rows.take(order)}]))
    assert_same(a, b)


def test_a_log_gives_back_the_same_rows():
    rows = residuals(25)
    again = logged(channels.NETWORK_RESIDUALS.name, rows)
    stage = BaselineErrors(BASELINE)
    a = errors(run_stage(stage, config(), [{RESIDUALS: rows}]))
    assert_same(a, errors(run_stage(stage, config(), [{RESIDUALS: again}])))


def test_without_residuals_there_is_nothing():
    parts = run_stage(BaselineErrors(BASELINE), config(), [{}])
    assert parts == [{}, {}]


def test_multipath_and_noise_are_all_of_a_residual():
    table = {
        "integers": {"phase_sigma": [0.005, 0.008, 0.01]},
        "errors": {"multipath_sigma": 0.004},
    }
    np.testing.assert_allclose(multipath_share(config(**table)), [0.64, 0.25, 0.16], rtol=1e-15)
    # The second frequency's residuals leave more to noise: the same one moves its error less.
    rows = residuals(1)
    rows = rows.take((rows["satellite"] == b"G11") | (rows["satellite"] == b"G24"))
    rows.values["residual_std_m"][:] = 0.01
    table["errors"]["error_sigma"] = 1e-9
    out = errors(run_stage(BaselineErrors(BASELINE), config(**table), [{RESIDUALS: rows}]))
    share = np.where(out["signal"] == b"1C", 0.64, 0.25)
    np.testing.assert_allclose(out["multipath_m"], share * rows["residual_m"], rtol=1e-9)


@pytest.mark.parametrize("cls", [NetworkConfig, NetworkRtkConfig, NetworkInsConfig])
def test_settings_that_leave_no_noise_are_refused(cls):
    stage = BaselineErrors(BASELINE)
    stage.start(config(cls), Context({}, {}))
    with pytest.raises(ConfigurationError, match="multipath_sigma"):
        stage.start(config(cls, integers={"phase_sigma": [0.003]}), Context({}, {}))
    with pytest.raises(ConfigurationError, match="multipath_tau"):
        stage.start(config(cls, errors={"multipath_tau": 0.0}), Context({}, {}))
    with pytest.raises(ConfigurationError, match="phase_sigma"):
        stage.start(config(cls, integers={"phase_sigma": [0.01, 0.01]}), Context({}, {}))
