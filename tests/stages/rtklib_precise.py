"""RTKLIB's terms of precise positioning, in a process of its own.

`python -m tests.stages.rtklib_precise FOLDER` reads requests (JSON) from its input and writes
answers: the binding frees memory that is not its own where a process ends as usual.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pyrtklib as rtklib

# The library gives out parts of its tables as if they were the taker's to free: keep them all.
KEPT: list[Any] = []
SYSTEM = {"G": rtklib.SYS_GPS, "R": rtklib.SYS_GLO, "E": rtklib.SYS_GAL}


def doubles(values: Any) -> Any:
    array = rtklib.Arr1Ddouble(len(values))
    for place, value in enumerate(values):
        array[place] = float(value)
    return array


def gtime(time_ns: int, offset_s: float = 0.0) -> Any:
    week, rest = divmod(int(time_ns), 604_800 * 1_000_000_000)
    return rtklib.timeadd(rtklib.gpst2time(week, rest / 1e9), offset_s)


def answer(nav: Any, pcvs: Any, erp: Any, ask: dict[str, Any]) -> dict[str, Any]:
    name, now = ask["satellite"], gtime(ask["t"])
    satellite = rtklib.satno(SYSTEM[name[0]], int(name[1:]))
    pcv = rtklib.searchpcv(satellite, "", now, pcvs)
    KEPT.append(pcv)
    nav.pcvs[satellite - 1] = pcv
    rs, dts, var = (rtklib.Arr1Ddouble(n) for n in (6, 2, 1))
    sent = gtime(ask["t"], -ask["travel_s"])
    status = rtklib.peph2pos(sent, satellite, nav, 0, rs, dts, var)
    here, line, azel = doubles(ask["place"]), rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(2)
    distance = rtklib.geodist(rs, here, line)
    geodetic = rtklib.Arr1Ddouble(3)
    rtklib.ecef2pos(here, geodetic)
    rtklib.satazel(geodetic, line, azel)
    offset = rtklib.Arr1Ddouble(3)
    rtklib.satantoff(sent, rs, satellite, nav, offset)
    variation = rtklib.Arr1Ddouble(rtklib.NFREQ)
    rtklib.antmodel_s(pcv, ask["nadir_rad"], variation)
    antenna = rtklib.Arr1Ddouble(rtklib.NFREQ)
    receiver = rtklib.searchpcv(0, ask["antenna"], now, pcvs)
    KEPT.append(receiver)
    rtklib.antmodel(receiver, doubles((0, 0, 0)), azel, 1, antenna)
    moved = {}
    for option, term in ((1, "solid"), (4, "pole")):
        out = rtklib.Arr1Ddouble(3)
        rtklib.tidedisp(rtklib.gpst2utc(now), here, option, erp, doubles([0.0] * 66), out)
        moved[term] = [out[k] for k in range(3)]
    wet = rtklib.Arr1Ddouble(1)
    dry = rtklib.tropmapf(now, geodetic, azel, wet)
    return {
        "status": status,
        "clock_s": dts[0],
        "velocity": [rs[3 + k] for k in range(3)],
        "position": [rs[k] for k in range(3)],
        "distance": distance,
        "line": [line[k] for k in range(3)],
        "offset": [offset[k] for k in range(3)],
        "variation": [variation[k] for k in range(2)],
        "antenna": [antenna[k] for k in range(2)],
        **moved,
        "mapping": [dry, wet[0]],
    }


def main() -> None:
    folder = Path(sys.argv[1])
    nav, pcvs, erp = rtklib.nav_t(), rtklib.pcvs_t(), rtklib.erp_t()
    for path in sorted(folder.glob("*.sp3")):
        rtklib.readsp3(str(path), nav, 0)
    for path in sorted(folder.glob("*.clk")):
        rtklib.readrnxc(str(path), nav)
    for path in sorted(folder.glob("*.erp")):
        rtklib.readerp(str(path), erp)
    rtklib.readpcv(str(next(folder.glob("*.atx"))), pcvs)
    answers = [answer(nav, pcvs, erp, ask) for ask in json.load(sys.stdin)]
    sys.stdout.write(json.dumps(answers))
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
