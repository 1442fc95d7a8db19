"""Records that the loosely coupled filter reads, keeps and writes.

Plain structured numpy types: the compiled loop reads and writes their fields, and
the bytes of the state record are its dump, from which a replay can go on.
"""

from typing import Any, Final

import numpy as np

from replay.kernels.strapdown import NAVIGATION_DTYPE
from replay.kernels.transition import trail_dtype

MAX_STATES: Final = 29  # 26, and the three of a place that displacements are counted from
WINDOW: Final = 512  # inertial samples that the stop detector can look back at most

# What an epoch of a chain is.
LINK_BEGIN: Final = 1  # its first one
LINK_SUM: Final = 2  # compared with the place at its beginning
LINK_EACH: Final = 3  # compared with the place at the epoch before

# How far the filter has come.
WAITING: Final = 0  # for rest, or for motion
LEVELLED: Final = 1  # roll and pitch known, heading not
RUNNING: Final = 2

CONFIG_DTYPE: Final = np.dtype(
    [
        ("states", "<i8"),  # 15 or 21, without those of the vehicle
        ("mounting", "<i8"),  # 1 where mounting pitch and yaw are estimated
        ("lever", "<i8"),  # 1 where the point that does not slip is estimated
        ("squat", "<i8"),  # 1 where pitching under acceleration is estimated
        ("gyro_noise", "<f8", 3),  # rad/sqrt(s)
        ("accel_noise", "<f8", 3),  # m/s/sqrt(s)
        ("gyro_bias_sigma", "<f8", 3),  # rad/s
        ("gyro_bias_tau", "<f8"),  # s
        ("accel_bias_sigma", "<f8", 3),  # m/s^2
        ("accel_bias_tau", "<f8"),  # s
        ("gyro_scale_sigma", "<f8", 3),
        ("gyro_scale_tau", "<f8"),  # s
        ("accel_scale_sigma", "<f8", 3),
        ("accel_scale_tau", "<f8"),  # s
        ("mounting_sigma", "<f8"),  # rad
        ("mounting_noise", "<f8"),  # rad/sqrt(s)
        ("lever_sigma", "<f8", 2),  # m, forward and down
        ("squat_sigma", "<f8"),  # rad/(m/s^2)
        ("gyro_bias_initial", "<f8", 3),  # rad/s
        ("accel_bias_initial", "<f8", 3),  # m/s^2
        ("tilt_initial", "<f8"),  # rad
        ("heading_initial", "<f8"),  # rad
        ("velocity_initial", "<f8"),  # m/s
        ("rest_sigma", "<f8"),  # m/s^2 of the specific force at rest against gravity
        # alignment
        ("rest_time", "<f8"),  # s at rest before levelling
        ("course_speed", "<f8"),  # m/s from which the course gives the heading
        ("course_turn_rate", "<f8"),  # rad/s up to which it does
        # GNSS
        ("use_velocity", "<i8"),
        ("position_gate", "<f8"),  # chi-square of three
        ("velocity_gate", "<f8"),  # chi-square of three
        ("velocity_window", "<f8"),  # s over which the receiver averages velocity
        ("position_floor", "<f8", 3),  # m added to the stated deviation, in quadrature
        ("velocity_floor", "<f8", 3),  # m/s, likewise
        ("position_scale", "<f8"),  # factor on the stated deviation
        ("velocity_scale", "<f8"),
        ("rejections", "<i8"),  # in a row, after which a position is believed
        ("outage_limit", "<f8"),  # s without a position
        # stops
        ("zero_velocity", "<i8"),
        ("zero_rate", "<i8"),
        ("stop_window", "<f8"),  # s
        ("stop_interval", "<f8"),  # s between updates
        ("stop_block", "<i8"),  # samples that are averaged before the window is looked at
        ("stop_accel", "<f8"),  # m/s^2, largest block mean off the window's, each axis
        ("stop_gyro", "<f8"),  # rad/s, likewise about the down axis
        ("stop_rate", "<f8"),  # rad/s, mean rate about the down axis, bias removed
        ("stop_speed", "<f8"),  # m/s, above which the filter does not believe in a stop
        ("zero_velocity_sigma", "<f8"),  # m/s
        ("zero_rate_sigma", "<f8", 3),  # rad/s
        # non-holonomic
        ("non_holonomic", "<i8"),
        ("nhc_interval", "<f8"),  # s between updates
        ("nhc_smoothing", "<f8"),  # s, first-order low-pass of the rate at the lever arm
        ("nhc_right_sigma", "<f8"),  # m/s
        ("nhc_down_sigma", "<f8"),  # m/s
        ("nhc_rate_sigma", "<f8"),  # (m/s) per (rad/s) of turning, added in quadrature
        ("nhc_speed", "<f8"),  # m/s below which it is not used
        ("nhc_gate", "<f8"),  # chi-square of two
        ("nhc_lever", "<f8", 3),  # m, body, IMU to the point that does not slip
        # output and input
        ("solution_interval", "<i8"),  # ns
        ("imu_interval", "<f8"),  # s, nominal
        ("imu_gap", "<f8"),  # s from which an interval is a gap
    ],
    align=True,
)


def state_dtype(states: int) -> "np.dtype[np.void]":
    """Record of a filter with room for so many error states."""
    return np.dtype(
        [
            ("mode", "<i8"),
            ("t", "<i8"),  # ns, GPS: time of the navigation state
            ("imu_t", "<i8"),  # ns, of the last inertial sample; minus one before the first
            ("nav", NAVIGATION_DTYPE),
            ("P", "<f8", (states, states)),
            ("extra", "<i8"),  # states after those of the inertial system and the vehicle
            ("aux", "<f8", states),  # their values
            ("bg", "<f8", 3),  # rad/s
            ("ba", "<f8", 3),  # m/s^2
            ("sg", "<f8", 3),
            ("sa", "<f8", 3),
            ("mount", "<f8", 2),  # rad: pitch, yaw of the vehicle relative to the body
            ("point", "<f8", 3),  # m, body: where the vehicle does not slip
            (
                "squat",
                "<f8",
            ),  # rad/(m/s^2), per forward specific force, negative where the nose lifts
            ("w_smooth", "<f8", 3),  # rad/s, low-passed rate
            ("f_smooth", "<f8", 3),  # m/s^2, low-passed specific force
            ("w_raw", "<f8", 3),  # rad/s, last sample
            ("f_raw", "<f8", 3),  # m/s^2, last sample
            # stop detector
            ("window", "<f8", (WINDOW, 6)),
            ("window_head", "<i8"),
            ("window_count", "<i8"),
            ("stopped", "<i8"),
            ("stop_last", "<i8"),  # ns of the last stop decision
            ("nhc_last", "<i8"),  # ns of the last non-holonomic update
            # alignment
            ("rest_count", "<i8"),
            ("rest_sum", "<f8", 6),  # over the samples at rest
            ("rest_q", "<f8", 4),  # body at rest to a level frame of unknown heading
            ("rest_f", "<f8", 3),  # m/s^2, mean specific force at rest, body
            ("align_q", "<f8", 4),  # body now to the same frame
            ("align_v", "<f8", 3),  # m/s in the same frame, since the last rest
            ("align_fix_t", "<i8"),  # ns of the fix before, minus one where there is none
            ("align_fix_r", "<f8", 3),  # m, ECEF
            ("align_speed", "<f8"),  # m/s at the fix before, minus one where unknown
            # GNSS bookkeeping
            ("fix_t", "<i8"),  # ns of the last position that was used
            ("moved_t", "<i8"),  # ns since when displacement is summed
            ("moved", "<f8", 3),  # m, ECEF: integral of velocity since then
            ("moved_lever", "<f8", 3),  # m, ECEF: antenna lever arm then
            ("rejected", "<i8"),  # positions in a row
            ("in_outage", "<i8"),
            ("emitted_slot", "<i8"),  # solution intervals since the GPS epoch at the last row
            ("emitted_t", "<i8"),  # ns of the last row
            # chain of displacements
            ("chain_t", "<i8"),  # ns of its last epoch
            ("chain_sum", "<f8", 3),  # m, ECEF, since the place in `aux`
            ("chain_v", "<f8", 3),  # m/s, ECEF: mean before its last epoch, while aligning
            ("chain_span", "<f8"),  # s of that mean; 0 where there is none
        ],
        align=True,
    )


STATE_DTYPE: Final = state_dtype(MAX_STATES)

FIX_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("r", "<f8", 3),
        ("R", "<f8", 6),  # m^2, upper triangle, east north up
        ("has_v", "<i8"),
        ("v", "<f8", 3),
        ("V", "<f8", 6),  # m^2/s^2
        ("lever", "<f8", 3),
        ("window", "<f8"),  # s that the velocity is the mean of; 0 asks the settings
        # An epoch of a chain of displacements.
        ("chain", "<i8"),  # 0: none, a place; else one of the numbers below
        ("anchor", "<i8"),  # 1: where a chain begins the place counts as well
        ("since", "<i8"),  # ns of the epoch before
        ("d", "<f8", 3),  # m, ECEF, since then
        ("D", "<f8", 6),  # m^2, of what is compared
    ],
    align=True,
)

SOLUTION_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("r", "<f8", 3),
        ("v_enu", "<f8", 3),
        ("attitude", "<f8", 3),
        ("w_eb", "<f8", 3),
        ("cov", "<f8", 6),
        ("v_std", "<f8", 3),
        ("a_std", "<f8", 3),
        ("status", "<i8"),
    ],
    align=True,
)

EPOCH_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("r", "<f8", 3),
        ("v", "<f8", 3),
        ("q", "<f8", 4),
        ("bg", "<f8", 3),
        ("ba", "<f8", 3),
        ("sg", "<f8", 3),
        ("sa", "<f8", 3),
        ("mount", "<f8", 3),
        ("point", "<f8", 3),
        ("squat", "<f8"),
    ],
    align=True,
)

INNOVATION_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("kind", "<i8"),
        ("axis", "<i8"),
        ("z", "<f8"),
        ("s", "<f8"),
        ("r", "<f8"),
        ("accepted", "<i8"),
    ],
    align=True,
)

EVENT_DTYPE: Final = np.dtype(
    [("t", "<i8"), ("log_t", "<i8"), ("kind", "<i8"), ("value", "<f8"), ("note", "<i8")],
    align=True,
)


def work_dtype(states: int) -> "np.dtype[np.void]":
    """Scratch of a filter with room for so many error states.

    Nothing in it outlives a step but the trail, which a filter that records carries on.
    """
    return np.dtype(
        [
            ("T", "<f8", (states + 1, states + 1)),
            ("decay", "<f8", states),
            ("noise", "<f8", states),
            ("H", "<f8", (3, states)),
            ("h", "<f8", (3, states + 1)),
            ("index", "<i8", states),
            ("PH", "<f8", (3, states)),
            ("S", "<f8", (3, 3)),
            ("R", "<f8", (3, 3)),
            ("L", "<f8", (3, 3)),
            ("z", "<f8", 3),
            ("b", "<f8", states),
            ("gain", "<f8", states),
            ("dx", "<f8", states),
            ("q", "<f8", (2, 4)),
            ("axes", "<f8", (3, 3)),  # rows: unit vectors of the measurement's axes in ECEF
            ("M", "<f8", (3, 3)),
            ("N", "<f8", (3, 3)),
            ("f", "<f8", 3),  # m/s^2, body, sensor errors removed
            ("w", "<f8", 3),  # rad/s, body, sensor errors removed
            ("mean", "<f8", 6),
            ("part", "<f8", 6),
            ("decay_dt", "<f8"),  # s, interval that decay and noise belong to
            ("busy", "<i8"),  # states that time changes; those behind them are constants
            ("trail", trail_dtype(states)),
        ],
        align=True,
    )


WORK_DTYPE: Final = work_dtype(MAX_STATES)

# Numbers of schemas/filter.proto and schemas/solution.proto; a test compares them.
KIND_POSITION: Final = 1
KIND_VELOCITY: Final = 2
KIND_ZERO_VELOCITY: Final = 3
KIND_ZERO_RATE: Final = 4
KIND_NON_HOLONOMIC: Final = 5
AXIS_EAST: Final = 1
AXIS_FORWARD: Final = 4
AXIS_RIGHT: Final = 5
EVENT_LEVELLED: Final = 1
EVENT_ALIGNED: Final = 2
EVENT_REJECTED: Final = 3
EVENT_OUTAGE_BEGIN: Final = 4
EVENT_OUTAGE_END: Final = 5
EVENT_STOP_BEGIN: Final = 6
EVENT_STOP_END: Final = 7
EVENT_IMU_GAP: Final = 8
EVENT_TIME_BACKWARD: Final = 9
EVENT_NOT_FINITE: Final = 10
EVENT_RESET: Final = 11
STATUS_PREDICTED: Final = 1
STATUS_UPDATED: Final = 2
STATUS_OUTAGE: Final = 3


def new_state(states: int = MAX_STATES) -> np.ndarray[Any, Any]:
    """One state record of a filter that has seen nothing, with room for so many error states."""
    state = np.zeros(1, dtype=state_dtype(states))
    for name in ("imu_t", "align_fix_t", "fix_t", "moved_t", "emitted_t", "stop_last"):
        state[name] = -1
    state["nhc_last"] = -1
    state["align_speed"] = -1.0
    for quaternion in (state["nav"]["q"], state["align_q"], state["rest_q"]):
        quaternion[:, 0] = 1.0
    return state
