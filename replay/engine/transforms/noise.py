"""White noise on inertial samples and observations, the same from the same seed.

Every field has a stream of its own, keyed by seed, topic, field and how many transforms
the log went through before, so that noise that is added twice is not the same noise.
A row takes the same share of its stream however the log is cut into batches.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from replay.draws import stream
from replay.engine.transforms.settings import NoiseTerm
from replay.kernels.noise import normals
from replay.log.columns import Columns


class Noise:
    """Adds one term, batch by batch.

    Parameters
    ----------
    term : NoiseTerm
    seed : int
    earlier : int
        Transforms that the log went through before.

    Attributes
    ----------
    changed : int
        Values, or vectors, that noise was added to; what is absent stays so.
    """

    def __init__(self, term: NoiseTerm, seed: int, earlier: int) -> None:
        self.term = term
        self.changed = 0
        self._generator = stream(f"{seed}:{earlier}:{term.topic}:{term.field}")

    def apply(self, batch: dict[str, Columns]) -> dict[str, Columns]:
        """The batch with noise on its rows of the term's topic."""
        rows = batch.get(self.term.topic)
        if rows is None or len(rows) == 0:
            return batch
        column = np.asarray(rows[self.term.field], dtype=np.float64)
        drawn = self._draw(len(rows), 1 if column.ndim == 1 else column.shape[1])
        noisy = column + self.term.deviation * drawn.reshape(column.shape)
        present = rows.is_present(self.term.field)
        known = present if column.ndim == 1 else present[:, None]
        values = {**rows.values, self.term.field: np.where(known, noisy, column)}
        finite = np.isfinite(noisy) if column.ndim == 1 else np.isfinite(noisy).all(axis=1)
        self.changed += int((present & finite).sum())
        return {**batch, self.term.topic: dataclasses.replace(rows, values=values, payloads=None)}

    def _draw(self, rows: int, columns: int) -> npt.NDArray[np.float64]:
        """Standard normal numbers (rows, columns); a row takes whole pairs of the stream."""
        pairs = (columns + 1) // 2
        uniforms = self._generator.random((rows * pairs, 2))
        out = np.empty_like(uniforms)
        normals(uniforms, out)
        return out.reshape(rows, 2 * pairs)[:, :columns]

    def note(self) -> str:
        """What was done, for a person."""
        return f"noise {self.term} on {self.changed} rows"
