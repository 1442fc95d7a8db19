"""All measurements, one after the other, and one table at the end.

Run from the root of the checkout: ``python -m tools.bench [--quick] [--only NAME]``. Ratios
are against the named peer in the same process on the same machine; absolute times are of
this machine alone. `--quick` takes less data and leaves the cold start out.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

from rich.console import Console

from tools.bench import formats, gnss, network, ppp, ppp_ins, replaying, simulator, smoother, sweep
from tools.bench.row import Row, summary

BENCHES: dict[str, Callable[..., list[Row]]] = {
    "log": formats.bench_log,
    "process": replaying.bench_process,
    "memory": replaying.bench_memory,
    "filter": replaying.bench_filter,
    "view": formats.bench_view,
    "diff": formats.bench_diff,
    "gnss": gnss.bench_gnss,
    "network": network.bench_network,
    "ppp": ppp.bench_ppp,
    "ppp-ins": ppp_ins.bench_ppp_ins,
    "simulator": simulator.bench_simulator,
    "smoother": smoother.bench_smoother,
    "sweep": sweep.bench_sweep,
    "importers": formats.bench_importers,
    "elementary": formats.bench_elementary,
}


def main() -> None:
    """Measure what is asked for and print."""
    parser = argparse.ArgumentParser(prog="python -m tools.bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="less data, under a minute")
    parser.add_argument("--only", action="append", choices=BENCHES, help="may be repeated")
    chosen = parser.parse_args()
    console = Console()
    rows: list[Row] = []
    for name in chosen.only or BENCHES:
        begin = time.perf_counter()
        rows += BENCHES[name](quick=chosen.quick)
        console.print(f"{name}: measured in {time.perf_counter() - begin:.0f} s")
    console.print(summary(rows))


if __name__ == "__main__":
    main()
