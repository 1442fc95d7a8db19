"""Which runs the study has: seeds, outages, inertial units, rates, ways to make samples fewer.

The reference is what the paper takes for one: RTK/INS of a high-grade unit in the same vehicle,
smoothed. The rate of the inertial samples has no part in it nor in PPP alone, so these are run
once for each seed (PPP also with the outages). At the log's own rate both ways to make samples
fewer are the same run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from msgspec.structs import replace

from replay.batch.kan2022.published import RATES_HZ
from replay.batch.study import Options
from replay.batch.sweep.file import Case, SweepFile, cases_of
from replay.errors import UsageError
from replay.simulate import load_scenario

ALONE, TIGHT, REFERENCE = "alone", "tight", "reference"
"""Kinds of runs; the sweep of a row is one of them."""
MEASURE: Final = "replay.batch.kan2022.measure:measure"
INTEGRATE, DECIMATE = "integrate", "decimate"
_OF: Final = "/"  # between the kind of a run and its unit, in the name of a sweep


@dataclasses.dataclass(frozen=True, slots=True)
class Plan:
    """What the runs are made of.

    Attributes
    ----------
    scenario : Path
    units : mapping of str to mapping
        Inertial units: what goes over the scenario for each; the first is that of the figures.
    outages : tuple of str
        As `replay transform --outage` takes them; both are in one log.
    rates_hz : tuple of int
        The log's own first.
    alone, tight, reference : str
        Pipelines: without inertial samples, with them, and of the reference.
    reference_settings : tuple of str
        Which unit the reference uses.
    then : tuple of str
        Pipelines over the reference's log.
    """

    scenario: Path
    units: Mapping[str, Mapping[str, Any]]
    outages: tuple[str, ...]
    rates_hz: tuple[int, ...] = RATES_HZ
    alone: str = "ppp"
    tight: str = "ppp-ins-tc"
    reference: str = "rtk-ins-tc"
    reference_settings: tuple[str, ...] = ("imu.name=reference", "smoothing.record=true")
    then: tuple[str, ...] = ("smooth",)


# Places on the drive where the vehicle moves as it does all day, as far apart as in the paper.
PLAN: Final = Plan(
    scenario=Path(__file__).parent / "drive.toml",
    units={
        "icm-20602": {},
        "icm-20602-still": {
            "imu": {"errors": {"vibration_velocity": 0.0, "vibration_angle": 0.0}},
        },
        "tactical": {"imu": {"grade": "tactical"}},
    },
    outages=("1340,30,keep=3", "2370,30,keep=3"),
)


def plan_cases(plan: Plan, options: Options) -> tuple[Case, ...]:
    """Every run of a plan, all of one seed before the next.

    Raises
    ------
    UsageError
        For a label that is no inertial unit of the plan, or a scenario that cannot be read.
    """
    for label in options.labels:
        if label not in plan.units:
            raise UsageError(f"no unit {label!r}", mend=f"known: {', '.join(plan.units)}")
    units = [unit for unit in plan.units if not options.labels or unit in options.labels]
    first = load_scenario(plan.scenario).settings.seed
    outage: dict[str, list[Any]] = {"outage": [[], list(plan.outages)]}
    whole = {**outage, "imu_rate": list(plan.rates_hz), "imu_method": [INTEGRATE]}
    fewer = {**outage, "imu_rate": list(plan.rates_hz[1:]), "imu_method": [DECIMATE]}
    common = SweepFile(scenario=(str(plan.scenario),))
    sweeps = [
        replace(
            common,
            name=REFERENCE,
            pipeline=(plan.reference,),
            settings=plan.reference_settings,
            then=plan.then,
        ),
        replace(common, name=ALONE, pipeline=(plan.alone,), grid=outage),
        *(
            replace(
                common,
                name=f"{TIGHT}{_OF}{unit}",
                pipeline=(plan.tight,),
                over=dict(plan.units[unit]),
                grid=grid,
            )
            for unit in units
            for grid in (whole, fewer)
            if grid["imu_rate"]
        ),
    ]
    return tuple(
        case
        for number in range(options.seeds)
        for sweep in sweeps
        for case in cases_of(
            replace(sweep, grid={"seed": [first + number], **sweep.grid}),
            Path(),
            measure=MEASURE,
        )
    )


def kind_of(sweep: str) -> tuple[str, str]:
    """Kind of run and unit of a sweep's name; the unit is empty where it has no part."""
    kind, _, unit = sweep.partition(_OF)
    return kind, unit
