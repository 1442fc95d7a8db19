"""Which satellites a search for integers leaves out, one after another."""

import numpy as np
import pytest

from replay.kernels.gnss_records import SATELLITES
from replay.kernels.integers import ATTEMPT_DTYPE, DONE, next_try
from replay.kernels.rtk_records import (
    MEASURE_DTYPE,
    PAIR_DTYPE,
    RTK_CONFIG_DTYPE,
    RTK_STATE_DTYPE,
)

# Satellite: epochs in use of its two phases, elevation (rad).
SEEN = {
    4: ((900, 40), 0.3),
    7: ((30, 700), 1.2),
    11: ((90, 80), 0.9),
    15: ((600, 500), 0.6),
    20: ((450, 450), 0.2),
    23: ((300, 300), 1.4),
}
PROVEN = 100
# The newest phase counts, and from PROVEN epochs on all are of one age: then the lowest goes first.
ORDER = [7, 4, 11, 20, 15, 23]
LEAST = 4


def search(drops, passing, candidates=lambda out: 12 - 2 * len(out)):
    """The sets of satellites left out, and the attempt that holds, numbered from one."""
    measures = np.zeros(2 * len(SEEN), dtype=MEASURE_DTYPE)
    seen = np.zeros(len(SEEN), dtype=PAIR_DTYPE)
    s, cfg = np.zeros(1, dtype=RTK_STATE_DTYPE)[0], np.zeros(1, dtype=RTK_CONFIG_DTYPE)[0]
    cfg["least"], cfg["proven"] = LEAST, PROVEN
    for pair, (satellite, (ages, elevation)) in enumerate(SEEN.items()):
        seen[pair]["elevation"] = elevation
        for slot, age in enumerate(ages):
            m = measures[2 * pair + slot]
            m["pair"], m["satellite"], m["slot"] = pair, satellite, slot
            s["lock"][satellite, slot] = age
    eligible = np.ones(len(measures), dtype=np.int64)
    left_out, tries = np.zeros(SATELLITES, dtype=np.int64), np.zeros(2, dtype=ATTEMPT_DTYPE)
    tried, turn = [], 0
    while turn != DONE:
        out = set(np.flatnonzero(left_out).tolist())
        tried.append(out)
        attempt = tries[1 if turn > 0 else 0]
        attempt["fixed"], attempt["passed"] = len(tried), out == passing
        turn = next_try(
            measures, len(measures), seen, eligible, s, cfg, drops, candidates(out), turn,
            left_out, tries,
        )  # fmt: skip
    return tried, int(tries[0]["fixed"]), bool(tries[0]["passed"])


@pytest.mark.parametrize("drops", [1, 3, 4])
def test_where_nothing_helps_the_newest_and_lowest_go_first_and_all_are_tried_again(drops):
    tried, holds, passed = search(drops, passing=None)
    assert tried == [set(ORDER[:n]) for n in range(drops + 1)] + [set()]
    assert (holds, passed) == (len(tried), False)


@pytest.mark.parametrize("wanted", [0, 1, 3])
def test_the_first_attempt_that_passes_holds(wanted):
    tried, holds, passed = search(5, passing=set(ORDER[:wanted]))
    assert tried == [set(ORDER[:n]) for n in range(wanted + 1)]
    assert (holds, passed) == (wanted + 1, True)


def test_without_leave_to_drop_one_attempt_is_all():
    assert search(0, passing=None) == ([set()], 1, False)


def test_too_few_candidates_end_the_search_even_if_they_pass():
    few = set(ORDER[:2])
    tried, holds, passed = search(
        5, passing=few, candidates=lambda out: LEAST - 1 if out == few else 12
    )
    assert tried == [set(), {ORDER[0]}, few, set()]
    assert (holds, passed) == (4, False)


def test_no_more_satellites_are_left_out_than_there_are():
    tried, _, passed = search(50, passing=None, candidates=lambda out: 12)
    assert tried == [set(ORDER[:n]) for n in range(len(SEEN) + 1)] + [set()]
    assert not passed
