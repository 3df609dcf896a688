"""The fit of the 5,000 Hénon-Heiles pairs from NumPy beside the program's own.

    $ cargo build --release && pip install ./python      (a release build, as pip makes it)
    $ python python/benches/speed.py target/release/leverrier

Both take turns, so that what else the machine does falls on both. The program's time is the field
`elapsed` of `fit --format json`: reading the file and fitting it, without the start of the process.
That of Python is `spec.fit(X, t=t, run=run)`: arrays in, a law out.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import leverrier

SPEC = Path(__file__).resolve().parents[2] / "examples/henon-heiles/degree6.ham"
TURNS = 25


def main() -> None:
    program = sys.argv[1] if len(sys.argv) > 1 else "leverrier"
    table = np.genfromtxt(SPEC.parent / "pairs.csv", delimiter=",", names=True)
    names = list(table.dtype.names)
    spec = leverrier.open(SPEC)
    states = [name for name in names if name not in ("run", "t")]
    X = np.column_stack([table[name] for name in states])
    t, run = table["t"].copy(), table["run"].copy()
    here, there = [], []
    for _ in range(TURNS):
        start = time.perf_counter()
        law = spec.fit(X, t=t, run=run, progress=False)
        here.append(time.perf_counter() - start)
        command = [program, "fit", str(SPEC), "--format", "json", "-o", "/dev/null"]
        done = subprocess.run(command, capture_output=True, check=True)
        there.append(json.loads(done.stdout)["elapsed"])
    print(f"{len(law.terms)} terms from {len(X)} rows, the fastest and the median of {TURNS}")
    for what, seconds in [("from NumPy", here), ("the program", there)]:
        print(f"{what:12} {1e3 * min(seconds):8.2f} ms {1e3 * np.median(seconds):8.2f} ms")
    print(f"ratio        {min(here) / min(there):8.2f}    {np.median(here) / np.median(there):8.2f}")


if __name__ == "__main__":
    main()
