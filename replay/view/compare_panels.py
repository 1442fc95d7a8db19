"""Panels of several methods over one another."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from replay.evaluate.compare import Method
from replay.evaluate.errors_enu import Errors
from replay.evaluate.geometry import Floats
from replay.evaluate.satellites import ALL, dilution, satellite_counts
from replay.log.columns import Columns
from replay.view.gather import Run, RunData
from replay.view.geometry_panels import dop_limits
from replay.view.labels import LOCAL_AXES
from replay.view.palette import run_ink
from replay.view.panels import (
    Curve,
    Panel,
    Section,
    broken,
    finite_curve,
    panel,
    robust_limits,
)


def compare_panels(methods: Sequence[Method]) -> list[Panel]:
    """Errors of position and of its change, satellites and PDOP."""
    return [
        *_error_panels(methods, Section.POSITION_ERROR, "position_error", lambda m: m.position),
        *_error_panels(methods, Section.CHANGE_ERROR, "position_change_error", lambda m: m.change),
        *_geometry_panels(methods),
    ]


def _error_panels(
    methods: Sequence[Method], section: Section, key: str, errors: Callable[[Method], Errors]
) -> list[Panel]:
    panels: list[Panel] = []
    for axis, name in enumerate(LOCAL_AXES):
        curves = [
            broken(Curve(m.name, m.name, errors(m).times_ns, errors(m).values[:, axis], run_ink(i)))
            for i, m in enumerate(methods)
        ]
        panels += panel(
            section,
            f"{key}/{name}",
            f"{section.value} {name}",
            "m",
            curves,
            limits=robust_limits([curve.values for curve in curves]),
        )
    return panels


def _geometry_panels(methods: Sequence[Method]) -> list[Panel]:
    def lines(values: Callable[[Columns], Floats]) -> list[Curve]:
        return [
            broken(
                finite_curve(
                    Curve(
                        m.name,
                        m.name,
                        m.data.geometry.valid_time_ns,
                        values(m.data.geometry),
                        run_ink(i),
                    )
                )
            )
            for i, m in enumerate(methods)
            if m.data.geometry is not None
        ]

    counts = lines(lambda geometry: satellite_counts(geometry)[ALL])
    pdops = lines(lambda geometry: dilution(geometry, "pdop"))
    return [
        *panel(
            Section.GEOMETRY,
            "geometry/satellites",
            "Satellites used",
            "1",
            counts,
            row="satellites",
        ),
        *panel(
            Section.GEOMETRY,
            "geometry/pdop",
            "PDOP",
            "1",
            pdops,
            row="pdop",
            limits=dop_limits([curve.values for curve in pdops]),
        ),
    ]


def compared_data(methods: Sequence[Method]) -> RunData:
    """The methods as runs over the first one's truth, in their order, for plan and scene."""
    return RunData(
        truth=methods[0].data.truth,
        fixes={},
        observations={},
        runs=tuple(
            Run(m.name, solution=m.data.solution, geometry=m.data.geometry) for m in methods
        ),
        stats={},
        outages=(),
        metadata={},
    )


def span_of(methods: Sequence[Method]) -> tuple[int, int]:
    """First and last time of all solutions, GPS ns."""
    times = [m.data.solution.valid_time_ns for m in methods]
    return min(int(t[0]) for t in times), max(int(t[-1]) for t in times)
