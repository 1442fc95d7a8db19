"""What is measured of a run where the evaluation's figures are not enough.

A measure is a function of the top level of a module, named as `module:function`, because
another process calls it and a case's key holds its name. It is given the log and gives
figures, which become columns of the row, and series, which become lists in it: so a table or
a picture is made from rows alone, without the logs.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy.typing as npt

from replay.errors import UsageError


@dataclasses.dataclass(frozen=True, slots=True)
class Measures:
    """What a measure takes from one run.

    Attributes
    ----------
    figures : mapping of str to float or str
        A figure that is not known is left out.
    series : mapping of str to array (n,)
        Numbers; each of its own length.
    """

    figures: Mapping[str, float | str]
    series: Mapping[str, npt.NDArray[Any]] = dataclasses.field(default_factory=dict)


Measure = Callable[[Path], Measures]


def find_measure(name: str) -> Measure:
    """Measure of a name.

    Raises
    ------
    UsageError
        Where there is none.
    """
    module, _, function = name.partition(":")
    try:
        found: Measure = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise UsageError(f"no measure {name!r}: {error}", mend="write module:function") from error
    return found
