"""The median."""

from numba import njit

from replay.kernels.types import Array


@njit(cache=True)
def median(values: Array, count: int) -> float:
    """Median of the first `count` of `values`, which are sorted in place."""
    for i in range(1, count):
        value = values[i]
        j = i - 1
        while j >= 0 and values[j] > value:
            values[j + 1] = values[j]
            j -= 1
        values[j + 1] = value
    middle = count // 2
    if count % 2 == 1:
        return values[middle]
    return 0.5 * (values[middle - 1] + values[middle])
