"""Smoothed positions relative to a base."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.kernels import rtk_records
from replay.kernels.smoothed_rows import smoothed_relative
from replay.kernels.transition import GIVEN_INTEGERS
from replay.log.columns import Columns, Ragged
from replay.schemas import solution_pb2
from replay.stages.rtk_columns import baseline_columns

Array = np.ndarray[Any, Any]


def is_relative(names: tuple[str, ...]) -> bool:
    """Whether a filter with these states knows its position from a base alone."""
    return names[0].startswith("baseline_")


def smoothed_baselines(
    nodes: Columns, own: Columns, solution: Columns, errors: Ragged, covariances: Ragged,
    shown: Array, absolute: Array,
) -> Columns:  # fmt: skip
    """Columns of `replay.RelativePosition` at nodes.

    Parameters
    ----------
    nodes : Columns of `replay.FilterTransition`
    own, solution : Columns of `replay.RelativePosition`, `replay.Solution`
        The run's own rows at the nodes. One less the other is the base's place: that which the
        run had, or where the base moves one that is as good.
    errors, covariances : Ragged
        What smoothing found.
    shown : int64 array (nodes,)
    absolute : bool array (nodes,)
        Where the first states are a place, else they are a baseline.
    """
    rows = np.zeros(len(nodes), dtype=rtk_records.BASELINE_ROW_DTYPE)
    rows["t"] = nodes.valid_time_ns
    rows["log_t"] = nodes.log_time_ns
    rows["age"] = own["base_age_s"]
    rows["status"] = own["status"]
    rows["status"][nodes["solution"] == GIVEN_INTEGERS] = solution_pb2.SOLUTION_STATUS_FLOAT
    estimates = nodes.ragged("estimate")
    smoothed_relative(
        (estimates.offsets, estimates.values), (errors.offsets, errors.values),
        (covariances.offsets, covariances.values), shown, absolute.astype(np.int64),
        np.ascontiguousarray(solution["position_ecef_m"]),
        np.ascontiguousarray(own["baseline_ecef_m"]), rows,
    )  # fmt: skip
    return baseline_columns(rows)
