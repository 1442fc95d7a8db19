"""Smoothing: a filter's run gone through backwards, so that later measurements count as well.

A run that was made with `smoothing.record` holds, for each of its nodes, how it came there
from the one before. Before the first row is taken the log's nodes are gone through from the last to
the first (:mod:`replay.kernels.smoother`), slice by slice, and what comes out waits on disk; the
rows then go through forwards as in any other stage. Solutions are smoothed at each of the run's
own, states and covariances at its updates; they bear the log times of the run's own rows,
though nothing of it can be known before the log's end.

What is smoothed are the filter's states: a solution that rests on integers which the filter did
not feed back is smoothed as the float one that it was to the filter. A run that says where the
receiver is relative to a base gets that smoothed too; where the base moves, and is itself known
no better than a single receiver is, it gets nothing else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import DataError
from replay.kernels import records
from replay.kernels.smoothed_rows import smoothed_solutions
from replay.kernels.transition import GIVEN_INTEGERS
from replay.log.columns import Columns, Ragged
from replay.schemas import solution_pb2
from replay.stages.base import Block, Context, Outputs, Port, StageSpec, dump_arrays, restore_arrays
from replay.stages.smooth_config import SmoothConfig
from replay.stages.smooth_pass import smooth_backwards
from replay.stages.smoothed_baselines import is_relative, smoothed_baselines
from replay.stages.spool import Spool

Array = np.ndarray[Any, Any]

_POSITION: Final = 3
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
    relative : bool
        Whether it says where the receiver is relative to a base (RELATIVE_POSITION).
    """

    def __init__(self, run: str, inertial: bool, relative: bool = False) -> None:
        self._inertial = inertial
        extra = (
            *((channels.FILTER_STATE,) if inertial else ()),
            *((channels.RELATIVE_POSITION,) if relative else ()),
        )
        read = tuple(Port(channel, run=run) for channel in extra)
        said = tuple(Port(channel) for channel in extra)
        self.spec = StageSpec(
            name="smooth",
            version=1,
            inputs=(
                Port(channels.FILTER_TRANSITION, run=run),
                Port(channels.SOLUTION, run=run),
                *read,
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
        nodes = context.backwards(name)
        return SmoothState(smooth_backwards(nodes, context.topics[name], config.smooth.method))

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
        own_rows = _own(at, block.get(channels.SOLUTION.name), "solution")
        errors = Ragged(found.error_starts, found.errors).take(said)
        covariances = Ragged(found.covariance_starts, found.covariances).take(said)
        shown = found.shown[said]
        numbers, lists = _names(at)
        moving = _of_names(
            [len(n) > _POSITION and n[_POSITION] == "velocity_ecef_x" for n in lists], numbers
        )
        scaled = _of_names(["gyro_scale_x" in n for n in lists], numbers)
        absolute = _of_names([not is_relative(n) for n in lists], numbers)
        rows, q = _solutions(at, own_rows, errors, covariances, shown, moving, scaled)
        outputs: Outputs = {}
        if channels.RELATIVE_POSITION.name in {port.channel.name for port in self.spec.outputs}:
            outputs[channels.RELATIVE_POSITION.name] = smoothed_baselines(
                at, _own(at, block.get(channels.RELATIVE_POSITION.name), "relative position"),
                own_rows, errors, covariances, shown, absolute,
            )  # fmt: skip
        solutions = _solution_columns(at, own_rows, rows, moving)
        if not absolute.all():
            solutions = solutions.take(np.flatnonzero(absolute))
        if len(solutions):
            outputs[channels.SOLUTION.name] = solutions
        whole = shown == at["dimension"]
        states = block.get(channels.FILTER_STATE.name)
        if self._inertial:
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
                    at.take(whole_rows), numbers[whole_rows], lists, states,
                    rows[whole_rows], q[whole_rows], errors.take(whole_rows),
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


def _own(nodes: Columns, rows: Columns | None, what: str) -> Columns:
    """The run's own row of each node.

    Raises
    ------
    DataError
        Where nodes have none.
    """
    place = _follow(nodes.valid_time_ns, rows)
    if rows is None or len(place) != len(nodes):
        raise DataError(
            f"{len(nodes) - len(place)} nodes have no {what} of their time",
            where="between log times "
            f"{int(nodes.log_time_ns[0])} and {int(nodes.log_time_ns[-1])} ns",
            mend="smooth the log as the filter's run wrote it",
        )
    return rows.take(place)


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


def _of_names(marks: list[bool], numbers: Array) -> Array:
    """What is marked of each list of names, as a mark of each node."""
    return np.array(marks, dtype=np.bool_)[numbers]


def _solutions(
    nodes: Columns, own: Columns, errors: Ragged, covariances: Ragged, shown: Array,
    moving: Array, scaled: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Records of SOLUTION_DTYPE, and attitudes (nodes, 4), body to ECEF."""
    rows = np.zeros(len(nodes), dtype=records.SOLUTION_DTYPE)
    q = np.zeros((len(nodes), 4))
    rates = np.nan_to_num(own["angular_rate_body_rad_s"].astype(np.float64))
    estimates, attitudes = nodes.ragged("estimate"), nodes.ragged("q_body_to_ecef")
    smoothed_solutions(
        (estimates.offsets, estimates.values), (attitudes.offsets, attitudes.values),
        (errors.offsets, errors.values), (covariances.offsets, covariances.values), shown,
        moving.astype(np.int64), scaled.astype(np.int64), np.ascontiguousarray(rates), q, rows,
    )  # fmt: skip
    return rows, q


def _solution_columns(nodes: Columns, own: Columns, rows: Array, moving: Array) -> Columns:
    """Solutions with the run's own status, times and presence of fields."""
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


def _states(
    nodes: Columns, numbers: Array, lists: list[tuple[str, ...]], states: Columns, rows: Array,
    q: Array, errors: Ragged,
) -> Columns:  # fmt: skip
    """The filter's states less what the smoother found wrong with them."""
    place = np.searchsorted(states.valid_time_ns, nodes.valid_time_ns, side="left")
    chosen = states.take(place.astype(np.int64))
    values: dict[str, Array] = {name: np.array(chosen[name]) for name in chosen.values}
    values["position_ecef_m"] = np.ascontiguousarray(rows["r"])
    values["q_body_to_ecef"] = q
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
