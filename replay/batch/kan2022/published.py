"""Figures that Kan, Gao and Min (2022) state in their text; what is absent is not stated there.

The bodies of tables 1 to 3 are pictures in the source that was read: a figure stands here only
where a sentence has it. Axes are east, north, up, and roll, pitch, heading.
"""

from __future__ import annotations

from typing import Final

Triple = tuple[float, float, float]

RATES_HZ: Final = (200, 100, 50, 20)

# Table 2, all satellites: root mean squares of position [cm], and how much better than PPP [%].
POSITION_CM: Final[dict[int, Triple]] = {200: (7.59, 19.53, 55.51)}
IMPROVEMENT_PERCENT: Final[dict[int, Triple]] = {200: (26.2, 51.1, 27.7)}
# The most by which the four rates differ; "north, east, and vertical" in the sentence, though
# every other triple of the paper begins with east.
POSITION_RANGE_CM: Final[Triple] = (0.63, 2.34, 3.79)
# Improvement of the position in space against 200 Hz [%].
SPATIAL_IMPROVEMENT_PERCENT: Final[dict[int, float]] = {100: 0.8, 50: 5.8, 20: 3.5}
VELOCITY_CM_S: Final[dict[int, Triple]] = {50: (6.12, 5.62, 2.02), 20: (2.10, 1.85, 2.08)}
ATTITUDE_DEG: Final[dict[int, Triple]] = {50: (0.602, 0.805, 3.911), 20: (0.103, 0.129, 1.021)}

# Table 3, two partial outages.
OUTAGE_POSITION_CM: Final[dict[int, Triple]] = {200: (10.35, 20.26, 51.60)}
OUTAGE_IMPROVEMENT_PERCENT: Final[dict[int, Triple]] = {200: (38.9, 56.8, 35.4)}
OUTAGE_POSITION_RANGE_CM: Final[Triple] = (0.09, 0.16, 4.98)
# PPP alone: east and up as printed; of north only "cm4.88" is left of a broken number.
OUTAGE_PPP_CM: Final[tuple[float, None, float]] = (16.94, None, 80.82)

# Figures 10 and 11: after 30 s with three satellites [cm].
DRIFT_CM: Final[dict[int, Triple]] = {
    200: (143.6, 37.30, 141.3),
    100: (34.20, 20.03, 53.67),
    50: (80.30, 21.170, 115.30),
    20: (55.02, 25.09, 60.99),
}
OUTAGE_S: Final = 30.0
OUTAGE_STARTS_S: Final = (532_768.0, 533_798.0)  # GPS time of the week
GYRO_INSTABILITY_DEG_H: Final = {"POS1100": 8.0, "ICM-20602": 50.0}

CONTRADICTIONS: Final = (
    "PPP alone with outages is printed as \u201c16.94 cm4.88 cm, and 80.82 cm\u201d. The printed"
    " improvements (38.9, 56.8, 35.4 %) over 10.35, 20.26 and 51.60 cm mean 16.94, 46.90 and"
    " 79.88 cm: east agrees, north has lost its first digit, up does not agree with 80.82 cm,"
    " which would be 36.2 %.",
    "The up error of 200 Hz is smaller with the outages (51.60 cm) than without (55.51 cm), though"
    " the drift at the end of one is 141.3 cm.",
    "With outages the rates are said to differ in east by 0.09 cm at most, but the drifts at the"
    " end differ by 109.4 cm. If the drifts are in the root mean squares, the last second of one"
    " outage alone, in an hour at 1 Hz, parts 200 from 100 Hz by 0.26 cm.",
    "The abstract names 20 and 50 Hz as best in outages; the text's smallest drifts are those of"
    " 100 Hz, and 50 Hz drifts three times as far in up as 100 Hz, so that the order of the rates"
    " is none.",
    "The text calls the same figures root mean squares, drifts after 30 s and maximum drifts.",
    "The differences among rates without outages (0.63, 2.34, 3.79 cm) are told in the order north,"
    " east, vertical; all else is east, north, up.",
    "One drive, one pair of outages and one unit: the paper has no spread, and does not say how"
    " samples were made fewer.",
)


def implied_ppp_cm(tight_cm: Triple, improvement_percent: Triple) -> Triple:
    """Root mean squares of PPP alone that an improvement in percent stands for [cm]."""
    east, north, up = (
        value / (1.0 - percent / 100.0)
        for value, percent in zip(tight_cm, improvement_percent, strict=True)
    )
    return east, north, up
