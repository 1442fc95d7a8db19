"""Systems, satellites and signals taken out of every receiver's observations."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay.channels import GNSS_OBS
from replay.engine.transforms.settings import Transform
from replay.errors import UsageError
from replay.log.columns import Columns
from replay.log.reader import LogReader

Mask = npt.NDArray[np.bool_]


class Removal:
    """Takes observations away, batch by batch.

    Parameters
    ----------
    reader : LogReader
    settings : Transform

    Attributes
    ----------
    decode : list of str
        Topics of observations.
    removed : dict of topic to int
        Rows left out so far.

    Raises
    ------
    UsageError
        Where the log has no observations.
    """

    def __init__(self, reader: LogReader, settings: Transform) -> None:
        self._path = reader.path
        names = (settings.remove_systems, settings.remove_satellites, settings.remove_signals)
        self._hits = {name: 0 for group in names for name in group}
        self._names = names
        self._seen: tuple[set[bytes], set[bytes], set[bytes]] = (set(), set(), set())
        self.removed: dict[str, int] = {}
        self.decode = [topic for topic in reader.channels if GNSS_OBS.matches(topic)]
        if self._hits and not self.decode:
            raise UsageError(
                "the log has no observations to take away",
                where=str(reader.path),
                mend="`replay info` shows the channels",
            )

    @property
    def wanted(self) -> bool:
        """Whether anything is to go."""
        return bool(self._hits)

    def apply(self, batch: dict[str, Columns]) -> dict[str, Columns]:
        """What stays of a batch."""
        kept = dict(batch)
        for topic in self.decode:
            if topic not in batch:
                continue
            out = self.gone(batch[topic])
            self.removed[topic] = self.removed.get(topic, 0) + int(out.sum())
            kept[topic] = batch[topic].take(~out)
        return kept

    def gone(self, rows: Columns) -> Mask:
        """Which observations go."""
        out = np.zeros(len(rows), dtype=np.bool_)
        for names, values, seen in zip(self._names, _labels(rows), self._seen, strict=True):
            if not names:
                continue
            seen.update(np.unique(values).tolist())
            for name in names:
                hit = values == name.encode("ascii")
                self._hits[name] += int(hit.sum())
                out |= hit
        return out

    def check(self) -> None:
        """Refuse a name that took nothing away.

        Raises
        ------
        UsageError
        """
        for names, seen in zip(self._names, self._seen, strict=True):
            missing = [name for name in names if self._hits[name] == 0]
            if missing:
                known = ", ".join(sorted(label.decode("ascii") for label in seen))
                raise UsageError(
                    f"no observation of {', '.join(missing)} to take away",
                    where=str(self._path),
                    mend=f"the log has {known}",
                )


def _labels(rows: Columns) -> tuple[npt.NDArray[np.bytes_], ...]:
    """System, satellite, and signal with its system, of each row."""
    satellite = rows["satellite"].astype("S3")
    system = satellite.astype("S1")
    return system, satellite, np.char.add(system, rows["signal"].astype("S2"))
