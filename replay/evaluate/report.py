"""What an evaluation says, as frozen structs: the shape of the JSON and of the table."""

from __future__ import annotations

from typing import Any

import msgspec

from replay.evaluate.ambiguities import Ambiguities
from replay.evaluate.availability import Availability
from replay.evaluate.consistency import Consistency, Nees
from replay.evaluate.outages import Outage, OutageSummary
from replay.evaluate.satellites import Geometry
from replay.evaluate.station import Station
from replay.evaluate.statistics import Statistics


class Counts(msgspec.Struct, frozen=True, kw_only=True):
    """How many rows stand behind the figures.

    Attributes
    ----------
    solution_rows, truth_rows : int
    fixed_truth_only : bool
        Whether truth without fixed ambiguities was left out.
    compared_rows : int
        Rows of the solution with a position error.
    without_truth_rows : int
        Rows of the solution at whose times truth is not known.
    epoch_rows : int
        Rows in `position_error_m`: updates outside outages.
    change_pairs : int
        Pairs of consecutive epochs in `position_change_error_m`.
    velocity_rows, attitude_rows : int
        As `compared_rows`.
    position_updates, position_rejections : int or None
        Epochs whose position the filter used or refused; None where the log does not tell,
        as where the filter is given ranges and no positions.
    """

    solution_rows: int
    truth_rows: int
    fixed_truth_only: bool
    compared_rows: int
    without_truth_rows: int
    epoch_rows: int
    change_pairs: int
    velocity_rows: int
    attitude_rows: int
    position_updates: int | None
    position_rejections: int | None


class Evaluation(msgspec.Struct, frozen=True, kw_only=True):
    """A run against truth.

    Errors are solution minus truth in local axes at the truth's point. Keys of the
    local axes are east, north, up, horizontal and 3d, those of the attitude roll,
    pitch and heading. A quantity that truth or the run does not have is None.

    Attributes
    ----------
    run : str
    solution_of : str
        "imu" where the solution has attitude and was moved to the truth's point, "antenna"
        where it has none and was compared as it stands, "both" where it comes and goes.
    start_ns : int, GPS ns
        First row of the solution; seconds of outages count from it.
    position_error_m, velocity_error_m_s, attitude_error_deg : dict of Statistics or None
        At the epochs of GNSS (rows with an update at their very time) outside outages.
    position_error_all_m, velocity_error_all_m_s, attitude_error_all_deg
        The same at all rows, outages included.
    position_change_error_m : dict of Statistics or None
        Of the change of position from each of these epochs to the next.
    position_error_fixed_m : dict of Statistics or None
        At rows with integer ambiguities.
    outages : tuple of Outage
        Those that the log's metadata names, else gaps between used positions.
    outage_summary : OutageSummary
    nees : Nees
        At the epochs of GNSS outside outages.
    nis : dict of dict of Consistency, or None
        By kind of measurement and axis; None where the log has no innovations.
    geometry : Geometry or None
    ambiguities : Ambiguities or None
    availability : Availability or None
        None where the log has no observations.
    station : Station or None
        None where truth moves.
    counts : Counts
    """

    run: str
    solution_of: str
    start_ns: int
    position_error_m: dict[str, Statistics] | None
    position_error_all_m: dict[str, Statistics] | None
    position_change_error_m: dict[str, Statistics] | None
    position_error_fixed_m: dict[str, Statistics] | None
    velocity_error_m_s: dict[str, Statistics] | None
    velocity_error_all_m_s: dict[str, Statistics] | None
    attitude_error_deg: dict[str, Statistics] | None
    attitude_error_all_deg: dict[str, Statistics] | None
    outages: tuple[Outage, ...]
    outage_summary: OutageSummary
    nees: Nees
    nis: dict[str, dict[str, Consistency]] | None
    geometry: Geometry | None
    ambiguities: Ambiguities | None
    availability: Availability | None
    station: Station | None
    counts: Counts

    def to_json_dict(self) -> dict[str, Any]:
        """Plain dicts, lists, numbers, texts and None."""
        # By way of JSON, so that a tuple is a list here as it is for those who read the file.
        plain: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return plain
