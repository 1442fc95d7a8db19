"""Whether the integers of a run of `ppp` stay what they are.

Run: `python tools/ppp_integers.py RUN.mcap`, over the log of a run with
`ppp.ambiguities.mode=continuous`.

The integers of a system's signal are known but for one number for all of its satellites, which
changes with the satellite that they are differences from. From the last epoch back, each epoch is
brought to the same number by what most of its satellites say; an integer that differs from
what its satellite has later, without a break in between, was wrong then or is wrong later.
Those of fixed epochs are told: the others nobody believed.
"""

import argparse
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

from replay import channels
from replay.log.reader import LogReader
from replay.schemas import filter_pb2, solution_pb2

RUN = "ppp"
SLIP = filter_pb2.EVENT_KIND_CYCLE_SLIP
Key = tuple[str, str]


def breaks_of(reader: LogReader) -> dict[str, list[int]]:
    """Times at which phases of a satellite broke."""
    found: dict[str, list[int]] = defaultdict(list)
    events = reader.read(channels.FILTER_EVENTS.at(run=RUN))
    texts = events.ragged("detail").texts()
    for t, kind, text in zip(events.valid_time_ns, events["kind"], texts, strict=True):
        if kind == SLIP:
            found[text[:3]].append(int(t))
    return found


def differing(
    epochs: dict[int, dict[Key, int]], breaks: dict[str, list[int]]
) -> list[tuple[int, Key, int]]:
    """Time, satellite with signal, and cycles of each integer that is another one later."""
    later: dict[Key, tuple[int, int]] = {}
    found = []
    for t in sorted(epochs, reverse=True):
        groups: dict[Key, list[Key]] = defaultdict(list)
        for satellite, signal in epochs[t]:
            groups[satellite[0], signal].append((satellite, signal))
        for keys in groups.values():
            off = {
                key: later[key][0] - epochs[t][key]
                for key in keys
                if key in later and not any(t < b <= later[key][1] for b in breaks[key[0]])
            }
            number = Counter(off.values()).most_common(1)[0][0] if off else 0
            for key in keys:
                if off.get(key, number) != number:
                    found.append((t, key, number - off[key]))
                else:
                    later[key] = (epochs[t][key] + number, t)
    return found


def main() -> None:
    """Print the share, and which."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    arguments = parser.parse_args()
    with LogReader(arguments.run) as reader:
        rows = reader.read(channels.FILTER_AMBIGUITIES.at(run=RUN))
        solution = reader.read(channels.SOLUTION.at(run=RUN))
        breaks = breaks_of(reader)
    epochs: dict[int, dict[Key, int]] = defaultdict(dict)
    known = np.flatnonzero(np.isfinite(rows["integer_cycles"]))
    for k in known:
        key = rows["satellite"][k].decode(), rows["signal"][k].decode()
        epochs[int(rows.valid_time_ns[k])][key] = round(float(rows["integer_cycles"][k]))
    is_fixed = solution["status"] == solution_pb2.SOLUTION_STATUS_FIXED
    fixed = set(solution.valid_time_ns[is_fixed].tolist())
    wrong = [row for row in differing(epochs, breaks) if row[0] in fixed]
    total = sum(len(found) for t, found in epochs.items() if t in fixed)
    print(f"{total} integers of {len(fixed)} fixed epochs, {len(wrong)} are others later")
    first = int(solution.valid_time_ns[0])
    for t, (satellite, signal), cycles in sorted(wrong):
        print(f"{(t - first) / 60e9:.1f} min: {satellite} {signal} by {cycles:+d} cycles")


if __name__ == "__main__":
    main()
