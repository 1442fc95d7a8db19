"""Smoothing: a filter's run gone through backwards, so that later measurements count as well.

A run that was made with `smoothing.record` holds, for each of its nodes, how it came there
from the one before. Before the first row is taken the log's nodes are gone through from the last to
the first (:mod:`replay.kernels.smoother`), slice by slice, and what comes out waits on disk; the
rows then go through forwards as in any other stage. Solutions are smoothed at each of the run's
own, states and covariances at its updates; they bear the log times of the run's own rows,
though nothing of it can be known before the log's end.

What is smoothed are the filter's states: a solution that rests on integers which the filter did
not feed back is smoothed as the float one that it was to the filter.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import DataError, MissingChannelError
from replay.kernels import records, smoother
from replay.kernels.smoothed_rows import smoothed_solutions
from replay.kernels.transition import GIVEN_INTEGERS, SILENT
from replay.log.columns import Columns, Ragged, starts
from replay.schemas import solution_pb2
from replay.stages.base import Block, Context, Outputs, Port, StageSpec, dump_arrays, restore_arrays
from replay.stages.smooth_config import SmoothConfig
from replay.stages.spool import Found, Spool

Array = np.ndarray[Any, Any]

_NAVIGATION: Final = 9
_POSITION: Final = 3
_WHY: Final = {
    smoother.OTHER_STATES: "its number of states is not what the node after it goes back to",
    smoother.OTHER_TIME: "its time is not what the node after it goes back to",
}
_STATE_OF: Final = {
    **{
        f"{name}_{axis}": (field, place)
        for name, field in (
            ("gyro_bias", "gyro_bias_body_rad_s"),
            ("accel_bias", "accel_bias_body_m_s2"),
            ("gyro_scale", "gyro_scale_factor"),
            ("accel_scale", "accel_scale_factor"),
        )
        for place, axis in enumerate("xyz")
    },
    "mounting_pitch": ("mounting_angles_rad", 1),
    "mounting_yaw": ("mounting_angles_rad", 2),
    "non_slip_point_forward": ("non_slip_point_body_m", 0),
    "non_slip_point_down": ("non_slip_point_body_m", 2),
}
_COUNT: Final = np.dtype(np.int64)


@dataclasses.dataclass(slots=True)
class SmoothState:
    """Everything that crosses from one block to the next."""

    spool: Spool


class Smoother:
    """The stage `smooth`.

    Parameters
    ----------
    run : str
        Name of the run that is smoothed.
    inertial : bool
        Whether it says its state (FILTER_STATE).
    """

    def __init__(self, run: str, inertial: bool) -> None:
        states = (Port(channels.FILTER_STATE, run=run),) if inertial else ()
        said = (Port(channels.FILTER_STATE),) if inertial else ()
        self.spec = StageSpec(
            name="smooth",
            version=1,
            inputs=(
                Port(channels.FILTER_TRANSITION, run=run),
                Port(channels.SOLUTION, run=run),
                *states,
            ),
            outputs=(*said, Port(channels.FILTER_COVARIANCE), Port(channels.SOLUTION)),
            trigger=Port(channels.FILTER_TRANSITION, run=run),
        )

    def start(self, config: Section, context: Context) -> SmoothState:
        """State before the first row: all nodes gone through from the end."""
        if not isinstance(config, SmoothConfig):
            raise TypeError("smooth takes a SmoothConfig")
        if context.backwards is None:
            raise TypeError("smooth needs a log that can be read backwards")
        name = channels.FILTER_TRANSITION.name
        return SmoothState(smooth_backwards(context.backwards(name), context.topics[name]))

    def step(self, state: SmoothState, block: Block) -> tuple[SmoothState, Outputs]:
        """Take a block of nodes and of what the filter said at them."""
        nodes = block.get(channels.FILTER_TRANSITION.name)
        if nodes is None or len(nodes) == 0:
            return state, {}
        found = state.spool.take(len(nodes))
        said = np.flatnonzero(found.shown >= 0)
        if len(said) == 0:
            return state, {}
        at = nodes.take(said)
        solution = block.get(channels.SOLUTION.name)
        own = _follow(at.valid_time_ns, solution)
        if solution is None or len(own) != len(said):
            raise DataError(
                f"{len(said) - len(own)} nodes have no solution of their time",
                where="between log times "
                f"{int(at.log_time_ns[0])} and {int(at.log_time_ns[-1])} ns",
                mend="smooth the log as the filter's run wrote it",
            )
        own_rows = solution.take(own)
        errors = Ragged(found.error_starts, found.errors).take(said)
        covariances = Ragged(found.covariance_starts, found.covariances).take(said)
        shown = found.shown[said]
        rows, q = _solutions(at, own_rows, errors, covariances, shown)
        outputs: Outputs = {channels.SOLUTION.name: _solution_columns(at, own_rows, rows)}
        whole = shown == at["dimension"]
        states = block.get(channels.FILTER_STATE.name)
        if len(self.spec.inputs) == _POSITION:
            # Where the filter said its state: once for each of its epochs.
            whole &= _marks(at, states)
        whole_rows = np.flatnonzero(whole)
        if len(whole_rows):
            outputs[channels.FILTER_COVARIANCE.name] = Columns.build(
                at.valid_time_ns[whole_rows],
                {
                    "dimension": at["dimension"][whole_rows],
                    "state_names": at.ragged("state_names").take(whole_rows),
                    "upper_triangle": covariances.take(whole_rows),
                },
                log_time_ns=at.log_time_ns[whole_rows],
            )
            if states is not None:
                outputs[channels.FILTER_STATE.name] = _states(
                    at.take(whole_rows), states, rows[whole_rows], q[whole_rows],
                    errors.take(whole_rows),
                )  # fmt: skip
        return state, outputs

    def finish(self, state: SmoothState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: SmoothState) -> bytes:
        """How many nodes were taken: all else is in the log."""
        return dump_arrays({"row": np.array([state.spool.row], dtype=np.int64)})

    def restore(self, state: SmoothState, data: bytes) -> SmoothState:
        """The state of a dump."""
        state.spool.skip(int(restore_arrays(data, {"row": _COUNT})["row"][0]))
        return state


def smooth_backwards(slices: Iterator[Columns], where: str) -> Spool:
    """Go back over all nodes of a run.

    Parameters
    ----------
    slices : iterator of Columns of `replay.FilterTransition`
        The last slice first.
    where : str
        For messages.

    Raises
    ------
    DataError
        Where a node does not follow the one before it: the log lacks some.
    """
    spool = Spool()
    carry = np.zeros(2, dtype=np.int64)
    lam, Lam = np.zeros(0), np.zeros((0, 0))
    for nodes in slices:
        size = 1 + int(max(nodes["dimension"].max(), nodes["dimension_before"].max(), carry[0]))
        if size > len(lam):
            lam, Lam = _grown(lam, size), _grown(Lam, size)
        found = _room(nodes)
        parts = {
            name: (nodes.ragged(name).offsets, nodes.ragged(name).values)
            for name in ("predicted_upper_triangle", "correction", "updated_upper_triangle")
        }
        transition = (
            nodes.ragged("value").offsets,
            nodes.ragged("row").values.astype(np.int64),
            nodes.ragged("column").values.astype(np.int64),
            nodes.ragged("value").values,
        )
        code = smoother.smooth_nodes(
            carry, lam, Lam, nodes.valid_time_ns, nodes["since_ns"],
            nodes["dimension_before"].astype(np.int64), nodes["dimension"].astype(np.int64),
            found.shown, transition, parts["predicted_upper_triangle"], parts["correction"],
            parts["updated_upper_triangle"], (found.error_starts, found.errors),
            (found.covariance_starts, found.covariances),
        )  # fmt: skip
        if code != smoother.OK:
            raise DataError(
                f"a node does not follow the one before it: {_WHY[code]}",
                where=f"{where}, log times {int(nodes.log_time_ns[0])} to "
                f"{int(nodes.log_time_ns[-1])} ns",
                mend="the run lacks rows: make it again",
            )
        spool.put(found)
    return spool


def _grown(array: Array, size: int) -> Array:
    larger = np.zeros((size,) * array.ndim)
    larger[tuple(slice(0, n) for n in array.shape)] = array
    return larger


def _room(nodes: Columns) -> Found:
    """Room for what is asked of each node: all of an update, navigation of other solutions."""
    dimension = nodes["dimension"].astype(np.int64)
    lengths = np.diff(nodes.ragged("correction").offsets)
    asked = nodes["solution"] != SILENT
    part = np.minimum(dimension, _NAVIGATION)
    shown = np.where(asked, np.where(lengths > 0, dimension, part), -1).astype(np.int64)
    error_starts = starts(np.where(asked, dimension, 0).astype(np.int64))
    covariance_starts = starts(np.where(asked, shown * (shown + 1) // 2, 0).astype(np.int64))
    return Found(
        shown,
        error_starts,
        np.zeros(error_starts[-1]),
        covariance_starts,
        np.zeros(covariance_starts[-1]),
    )


def _follow(times: Array, solution: Columns | None) -> Array:
    """Which solution belongs to each time (ns): the next one that has it, in order.

    Several nodes of one time have as many solutions.
    """
    if solution is None:
        return np.zeros(0, dtype=np.int64)
    first = np.searchsorted(solution.valid_time_ns, times, side="left")
    # The how-manieth node of its time each one is.
    order = np.arange(len(times))
    again = order - np.searchsorted(times, times, side="left")
    place = first + again
    fits = place < len(solution)
    fits[fits] = solution.valid_time_ns[place[fits]] == times[fits]
    return place[fits].astype(np.int64)


def _marks(nodes: Columns, states: Columns | None) -> Array:
    """Which nodes the filter said its state at: of several at one time the first."""
    marks = np.zeros(len(nodes), dtype=np.bool_)
    if states is None:
        return marks
    place = np.searchsorted(nodes.valid_time_ns, states.valid_time_ns, side="left")
    place = place[place < len(nodes)]
    marks[place] = np.isin(nodes.valid_time_ns[place], states.valid_time_ns)
    return marks


def _names(nodes: Columns) -> tuple[Array, list[tuple[str, ...]]]:
    """Names of the states of each node: which of the lists, and the lists."""
    known: dict[bytes, int] = {}
    texts = nodes.ragged("state_names").blobs()
    numbers = np.array([known.setdefault(text, len(known)) for text in texts], dtype=np.int64)
    return numbers, [tuple(text.decode().split(",")) for text in known]


def _solutions(
    nodes: Columns, own: Columns, errors: Ragged, covariances: Ragged, shown: Array
) -> tuple[Array, Array]:
    """Records of SOLUTION_DTYPE, and attitudes (nodes, 4), body to ECEF."""
    rows = np.zeros(len(nodes), dtype=records.SOLUTION_DTYPE)
    q = np.zeros((len(nodes), 4))
    numbers, lists = _names(nodes)
    moving = [len(n) > _POSITION and n[_POSITION] == "velocity_ecef_x" for n in lists]
    scaled = ["gyro_scale_x" in n for n in lists]
    rates = np.nan_to_num(own["angular_rate_body_rad_s"].astype(np.float64))
    estimates, attitudes = nodes.ragged("estimate"), nodes.ragged("q_body_to_ecef")
    smoothed_solutions(
        (estimates.offsets, estimates.values), (attitudes.offsets, attitudes.values),
        (errors.offsets, errors.values), (covariances.offsets, covariances.values), shown,
        np.array(moving, dtype=np.int64)[numbers], np.array(scaled, dtype=np.int64)[numbers],
        np.ascontiguousarray(rates), q, rows,
    )  # fmt: skip
    return rows, q


def _solution_columns(nodes: Columns, own: Columns, rows: Array) -> Columns:
    """Solutions with the run's own status, times and presence of fields."""
    numbers, lists = _names(nodes)
    moving = np.array(
        [len(n) > _POSITION and n[_POSITION] == "velocity_ecef_x" for n in lists], dtype=np.bool_
    )[numbers]
    turning = np.diff(nodes.ragged("q_body_to_ecef").offsets) > 0
    status = own["status"].astype(np.int32)
    status[nodes["solution"] == GIVEN_INTEGERS] = solution_pb2.SOLUTION_STATUS_FLOAT
    values = {
        "position_ecef_m": rows["r"],
        "velocity_enu_m_s": rows["v_enu"],
        "attitude_rad": rows["attitude"],
        "angular_rate_body_rad_s": rows["w_eb"],
        "position_covariance_enu_m2": rows["cov"],
        "velocity_std_enu_m_s": rows["v_std"],
        "attitude_std_rad": rows["a_std"],
        "status": status,
    }
    present: Mapping[str, Array] = {
        "velocity_enu_m_s": moving,
        "velocity_std_enu_m_s": moving,
        "attitude_rad": turning,
        "angular_rate_body_rad_s": turning & own.is_present("angular_rate_body_rad_s"),
        "attitude_std_rad": turning,
    }
    return Columns.build(
        nodes.valid_time_ns,
        {name: np.ascontiguousarray(value) for name, value in values.items()},
        log_time_ns=nodes.log_time_ns,
        present=present,
    )


def _states(nodes: Columns, states: Columns, rows: Array, q: Array, errors: Ragged) -> Columns:
    """The filter's states less what the smoother found wrong with them."""
    place = np.searchsorted(states.valid_time_ns, nodes.valid_time_ns, side="left")
    chosen = states.take(place.astype(np.int64))
    values: dict[str, Array] = {name: np.array(chosen[name]) for name in chosen.values}
    values["position_ecef_m"] = np.ascontiguousarray(rows["r"])
    values["q_body_to_ecef"] = q
    numbers, lists = _names(nodes)
    begins = errors.offsets[:-1]
    for number, names in enumerate(lists):
        at = np.flatnonzero(numbers == number)
        for column, name in enumerate(names):
            error = errors.values[begins[at] + column]
            if name in _STATE_OF:
                field, component = _STATE_OF[name]
                values[field][at, component] += error
            elif name.startswith("velocity_ecef_"):
                values["velocity_ecef_m_s"][at, column - _POSITION] += error
            elif name == "squat":
                values["squat_rad_s2_m"][at] += error
    return Columns.build(nodes.valid_time_ns, values, log_time_ns=nodes.log_time_ns)


def find_run(config: SmoothConfig, topics: Collection[str]) -> str:
    """The run to smooth.

    Raises
    ------
    MissingChannelError
        Where the log has no run that was recorded for smoothing, or not the one asked for.
    """
    spec = channels.FILTER_TRANSITION
    runs = [spec.parts(topic)["run"] for topic in topics if spec.matches(topic)]
    wanted = config.smooth.run
    if wanted in runs:
        return wanted
    if not wanted and len(runs) == 1:
        return runs[0]
    if runs:
        raise MissingChannelError(
            f"the log has {', '.join(sorted(runs))} to smooth"
            + (f", not {wanted}" if wanted else ""),
            mend=f"choose one: --set smooth.run={sorted(runs)[0]}",
        )
    raise MissingChannelError(
        f"the log has no run that can be smoothed: no channel {spec.topic}",
        where=f"it has {', '.join(sorted(topics)) or 'none'}",
        mend="run the filter again with --set smoothing.record=true, and smooth what it writes",
    )
