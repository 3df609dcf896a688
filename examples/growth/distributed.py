"""How a fit grows with worker processes: writes the last section of docs/growth.md.

    $ pip install --release ./python && pip install 'dask[distributed]' pyarrow
    $ python examples/growth/distributed.py                  1e6 and 1e7 transitions
    $ python examples/growth/distributed.py --largest 1e8    another 7 GB in a temporary folder

Files of noisy transitions are made in a temporary folder (--folder names another, and keeps them).
Every fit is made in this process alone, then by one worker process of Dask, then by two, in turn;
each worker has one thread, and so has this process. `--print` leaves the page alone.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import leverrier
from leverrier import distributed as parts

SPEC = """
coordinates q1, q2
momenta p1, p2
T = span{ tensor(p1, p2; 3) }
V = span{ tensor(q1, q2; 3) }
data "transitions" { time t  pairs }
"""
#: Time between the two samples of a transition, noise on every number.
STEP, SIGMA = 0.1, 0.005
#: Transitions of a file.
PART = 250_000
#: What the estimate is for.
TRANSITIONS, WORKERS, PART_OF_ESTIMATE = 1e10, 100, 1e6


def energy(q1, q2, p1, p2):
    return 0.5 * (p1 * p1 + p2 * p2 + q1 * q1 + q2 * q2) + q1 * q1 * q2 - q2**3 / 3


def later(q1, q2, p1, p2):
    """Two steps of the fourth-order method of Forest and Ruth."""
    outer = 1 / (2 - 2 ** (1 / 3))
    for part in 2 * [outer, 1 - 2 * outer, outer]:
        step = part * STEP / 2
        q1, q2 = q1 + 0.5 * step * p1, q2 + 0.5 * step * p2
        p1, p2 = p1 - step * (q1 + 2 * q1 * q2), p2 - step * (q2 + q1 * q1 - q2 * q2)
        q1, q2 = q1 + 0.5 * step * p1, q2 + 0.5 * step * p2
    return q1, q2, p1, p2


def write(path: Path, count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    chosen: list[np.ndarray] = []
    while sum(one.shape[1] for one in chosen) < count:
        ends = [(-1, 1), (-0.5, 1), (-1, 1), (-1, 1)]
        start = np.array([random.uniform(low, high, count) for low, high in ends])
        inside = (1 / 12 <= energy(*start)) & (energy(*start) < 1 / 6)
        chosen.append(start[:, inside])
    start = np.concatenate(chosen, axis=1)[:, :count]
    rows = np.stack([start, np.array(later(*start))], axis=2).reshape(4, 2 * count)
    rows += random.normal(0, SIGMA, rows.shape)
    columns = {"t": np.tile([0.0, STEP], count)}
    columns |= dict(zip(["q1", "q2", "p1", "p2"], rows))
    pq.write_table(pa.table(columns), path, row_group_size=100_000)


def made(folder: Path, transitions: int) -> list[str]:
    home = folder / f"transitions-{transitions}"
    home.mkdir(parents=True, exist_ok=True)
    each = min(PART, transitions // 4)
    files = [home / f"part-{at:05}.parquet" for at in range(transitions // each)]
    for seed, file in enumerate(files):
        if not file.exists():
            write(file, each, seed)
    return [str(file) for file in files]


class Timed(parts.Engine):
    """Another engine, and the seconds of its calls: the survey, then the passes."""

    def __init__(self, engine: parts.Engine) -> None:
        self.engine, self.seconds, self.bytes = engine, [], []

    def run(self, task, places, watch):
        start = time.perf_counter()
        given = self.engine.run(task, places, watch)
        self.seconds.append(time.perf_counter() - start)
        self.bytes.append(len(given))
        return given


def fitted(engine: parts.Engine) -> dict:
    timed = Timed(engine)
    start = time.perf_counter()
    law = parts.fit(leverrier.parse(SPEC), None, engine=timed, threads=1, progress=False)
    whole = time.perf_counter() - start
    survey, first, *refits = timed.seconds
    return {
        "survey": survey, "pass": first, "refits": sum(refits), "count": len(refits),
        "whole": whole, "here": whole - sum(timed.seconds), "bytes": timed.bytes, "law": law,
    }  # fmt: skip


def peak() -> float:
    """Peak resident memory of this process, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def by_dask(files: list[str], workers: int) -> dict:
    import distributed

    from leverrier._dask import Dask

    with (
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(__import__, "leverrier.distributed")
        found = fitted(Dask(files, client, (None, None)))
        found["memory"] = max(client.run(peak).values())
        return found


def cost_of_merging(files: list[str]) -> tuple[float, int, float, int]:
    """Seconds and bytes of the merge of two factors, and of two surveys."""
    kept: list[list[bytes]] = []

    class Kept(parts.Local):
        def run(self, task, places, watch):
            given = [
                task(part, places[at] if places else (at, 0, 0, 0))
                for at, part in enumerate(self.parts)
            ]
            kept.append(given)
            return self.merged(given)

    parts.fit(leverrier.parse(SPEC), None, engine=Kept(files[:2]), threads=1, progress=False)
    found: list = []
    for given in (kept[1], kept[0]):
        start = time.perf_counter()
        for _ in range(20):
            parts.merge(*given)
        found += [(time.perf_counter() - start) / 20, len(given[0])]
    return tuple(found)


def size(number: float) -> str:
    return f"1e{round(math.log10(number))}"


def duration(seconds: float) -> str:
    if seconds < 1:
        return f"{1e3 * seconds:.3g} ms"
    return f"{seconds:.3g} s" if seconds < 600 else f"{seconds / 60:.3g} min"


def amount(count: float) -> str:
    for unit in ["B", "KB", "MB", "GB"]:
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def estimate(one: dict, transitions: int, merging: tuple[float, int, float, int]) -> str:
    """What the measured costs make of more data and more workers."""
    merge, factor, merge_survey, survey = merging
    here = one["here"]
    each = {name: one[name] / transitions for name in ("survey", "pass", "refits")}
    count = TRANSITIONS / PART_OF_ESTIMATE
    depth = math.ceil(math.log2(count))
    passes = 1 + one["count"]
    work = TRANSITIONS * sum(each.values()) / WORKERS
    tree = depth * (merge_survey + passes * merge)
    # Merges of a worker's own parts, one after the other; then those that cross workers.
    own = (count / WORKERS) * (merge_survey + passes * merge)
    moved = WORKERS * (survey + passes * factor)
    # Work of all workers is as long as the tree and what is done here.
    fixed = here + tree
    most = TRANSITIONS * sum(each.values()) / fixed
    return f"""\
By these costs, {size(TRANSITIONS)} transitions on {WORKERS} workers of one core, in {count:,.0f} files of {size(PART_OF_ESTIMATE)}:

| what | on the way there | time |
|---|---|---|
| survey | {duration(each["survey"] * 1e6)} for 1e6 transitions | {duration(each["survey"] * TRANSITIONS / WORKERS)} |
| pass by all 30 terms | {duration(each["pass"] * 1e6)} for 1e6 transitions | {duration(each["pass"] * TRANSITIONS / WORKERS)} |
| refits, {one["count"]} passes | {duration(each["refits"] * 1e6)} for 1e6 transitions | {duration(each["refits"] * TRANSITIONS / WORKERS)} |
| merges of a worker's own parts | {duration(merge_survey)} for two surveys, {duration(merge)} for two factors; {count / WORKERS:,.0f} parts | {duration(own)} |
| the tree above them | {depth} levels for {count:,.0f} parts | {duration(tree)} |
| search, and all that is made on one core | as measured at {size(transitions)} | {duration(here)} |
| together | | {duration(work + own + tree + here)} |

Between workers travel {amount(moved)}: a survey of {amount(survey)} (its sample is most of it) and {passes} factors of {amount(factor)} from each, whatever the number of transitions. What does not shrink with workers is the search on one core and the tree, {duration(fixed)} together: from about {most:,.0f} workers on they take as long as all passes, and more workers do not pay. Files on a shared disk have to keep up: {amount(64 * TRANSITIONS / WORKERS / work * (1 + passes) * WORKERS)} a second for {WORKERS} workers at 64 bytes a transition. This is arithmetic on costs of this machine, not a measurement; it leaves out a scheduler's own time for {count:,.0f} tasks a pass (Dask's documentation speaks of about 1 ms each) and the time in which a lost worker is noticed.
"""


def page(rows: list[tuple[int, dict]], merging: tuple[float, int, float, int]) -> str:
    lines = []
    for transitions, found in rows:
        for name, one in found.items():
            memory = f"{one['memory']:.0f} MiB" if "memory" in one else "-"
            lines.append(
                f"| {size(transitions)} | {name} | {duration(one['survey'])} | {duration(one['pass'])} | "
                f"{duration(one['refits'])} in {one['count']} | {duration(one['whole'])} | {memory} |"
            )
    ratios = []
    for transitions, found in rows:
        alone, one, two = found["this process"], found["one worker"], found["two workers"]
        data = ("survey", "pass", "refits")
        shared = sum(one[name] for name in data) / sum(two[name] for name in data)
        ratios.append(
            f"{size(transitions)} transitions: two workers against one {shared:.2f} times as fast in all "
            f"that passes over the data, the first pass {one['pass'] / two['pass']:.2f} times, the whole "
            f"fit {one['whole'] / two['whole']:.2f} times; one worker takes "
            f"{100 * (one['whole'] / alone['whole'] - 1):+.1f} % beside this process alone."
        )
    transitions, found = rows[-1]
    table = "\n".join(lines)
    load = ", ".join(f"{one:.2f}" for one in os.getloadavg())
    return f"""\
## Beyond one machine

Regenerated by `python examples/growth/distributed.py` (`--largest 1e8` goes further), which makes its own data: files of {PART:,} noisy transitions of Hénon-Heiles, 30 candidate terms, read by worker processes of Dask with one thread each; the search here has one thread, too. {os.cpu_count()} cores, load averages {load} at the end.

| transitions | by | survey | pass, 30 terms | refits | whole fit | peak memory of a worker |
|---|---|---|---|---|---|---|
{table}

{chr(10).join(ratios)}

All of these laws of a size have the same bits, which the program checks.

{estimate(found["one worker"], transitions, merging)}"""


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    words.add_argument("--largest", type=float, default=1e7)
    words.add_argument("--smallest", type=float, default=1e6)
    words.add_argument("--folder", type=Path)
    words.add_argument("--print", action="store_true")
    asked = words.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = asked.folder or Path(temporary)
        transitions = int(asked.smallest)
        while transitions <= asked.largest * 1.001:
            files = made(folder, transitions)
            found = {
                "this process": fitted(parts.Local(files)),
                "one worker": by_dask(files, 1),
                "two workers": by_dask(files, 2),
            }
            laws = [one["law"].model.to_dict() for one in found.values()]
            assert laws[0] == laws[1] == laws[2], "the same bits"
            rows.append((transitions, found))
            transitions *= 10
        merging = cost_of_merging(files)
    text = page(rows, merging)
    print(text)
    if not asked.print:
        there = Path(__file__).resolve().parents[2] / "docs" / "growth.md"
        before = there.read_text().split("## Beyond one machine")[0].rstrip("\n")
        there.write_text(f"{before}\n\n{text}")


if __name__ == "__main__":
    main()
