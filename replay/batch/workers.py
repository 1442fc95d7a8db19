"""Processes that work beside each other, for as long as a study lasts.

They are spawned, not forked, so that they are alike on every system. A process takes seconds
to begin, so the same ones run the members of a study and draw its charts.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from types import TracebackType
from typing import Any, ParamSpec, Self, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")


class _Here(Executor):
    """Does each task when it is given, in this process."""

    def submit(self, fn: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> Future[_T]:
        future: Future[_T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # as another process would: told to who asks for the result
            future.set_exception(error)
        return future


class Workers:
    """Some processes; with one job all is done in this process.

    Parameters
    ----------
    jobs : int
        Processes, 1 or more.
    """

    def __init__(self, jobs: int = 1) -> None:
        self.jobs = jobs
        context = multiprocessing.get_context("spawn")
        self._pool: Executor = (
            _Here() if jobs == 1 else ProcessPoolExecutor(jobs, mp_context=context)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish what has begun; nothing else is begun."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def submit(self, work: Callable[..., _T], *given: Any) -> Future[_T]:
        """Have a function of the top level of a module called by a process that is free."""
        return self._pool.submit(work, *given)

    def call(self, tasks: Sequence[tuple[Callable[..., _T], tuple[Any, ...]]]) -> list[_T]:
        """Results of functions with their arguments, in the order of tasks.

        They begin in that order, so what takes longest is best told first.
        """
        futures = [self._pool.submit(work, *given) for work, given in tasks]
        return [future.result() for future in futures]
