"""The timing report: prints the worst figures of each cell. Arguments: ``--seconds``, ``--seeds``."""

import argparse
import os
from functools import partial
from multiprocessing import Pool

from stamping import LINES, spread, stamp

SKEWS = (-1e-4, -5e-5, 0.0, 5e-5, 1e-4)
LOSSES = (0.0, 1e-3, 1e-2)
SCENARIOS = ("driving", "IMU only, noisy gyro", "gyro stuck at (-6, -5, -4)", "IMU only, gyro stuck")

def one(seconds, job):
    line, scenario, loss, seed = job
    s = stamp(line, scenario, loss, SKEWS[seed % 5], seed, seconds)
    since = 2.0 if "block" not in line else 6.0
    e = s.errors(since)
    arr = type(s)(s.period_s, [(t, a, a) for t, _, a in s.samples])
    import statistics
    med = statistics.median(e)
    off = sum(abs(x - med) > 4e-3 for x in e) / len(e)
    return job, (s.unevenness(since), spread(e), max(e) - min(e), off, spread(arr.errors(since)), arr.unevenness(since))


def main():
    p = argparse.ArgumentParser()
    p.add_argument("--seconds", type=float, default=30.0)
    p.add_argument("--seeds", type=int, default=30)
    p.add_argument("--lines", default="")
    p.add_argument("--losses", default="")
    p.add_argument("--scenarios", type=int, default=2)
    c = p.parse_args()
    losses = [float(x) for x in c.losses.split(",")] if c.losses else LOSSES
    jobs = [(l, s, x, i) for l in LINES if c.lines in l for x in losses for s in SCENARIOS[:c.scenarios] for i in range(c.seeds)]
    cells = {}
    with Pool(2) as pool:
        for (l, s, x, i), r in pool.imap_unordered(partial(one, c.seconds), jobs, chunksize=2):
            cells.setdefault((l, s, x), []).append((r, i))
    for l in LINES:
        for x in losses:
            for s in SCENARIOS:
                rows = cells.get((l, s, x))
                if not rows: continue
                w = [max((r[k], i) for r, i in rows) for k in range(6)]
                med = sorted(r[0][0] for r in rows)[len(rows) // 2]
                flag = "" if w[0][0] < 2e-4 and w[1][0] < 5e-4 else " ***"
                print(f"{l:30s} {s:28s} {x:<6g} std {w[0][0]*1e3:6.3f}({w[0][1]:2d}) med {med*1e3:6.3f} 99% {w[1][0]*1e3:6.3f}({w[1][1]:2d}) range {w[2][0]*1e3:7.3f} off {w[3][0]:.4f} | arrival 99% {w[4][0]*1e3:6.3f} std {w[5][0]*1e3:6.3f}{flag}", flush=True)

main()
