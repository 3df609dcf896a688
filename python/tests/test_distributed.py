"""Data in parts: whatever engine passes over them, the law is the same to the bit."""

import os
import shutil
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import leverrier
from leverrier import distributed as parts

SPEC = """
coordinates q
momenta p
T = p^2/2
V = span{ poly(q; 4), cos(q) }
data "swings" { time t; run run }
"""


def swings(runs: int = 24, samples: int = 60) -> pd.DataFrame:
    """A pendulum's swings, from its equations of motion by fine steps, with noise."""
    random = np.random.default_rng(7)
    q = random.uniform(-2.0, 2.0, runs)
    p = random.uniform(-1.0, 1.0, runs)
    step, rows = 0.1 / 40, []
    for at in range(samples):
        rows.append((q.copy(), p.copy()))
        for _ in range(40):
            p -= 0.5 * step * np.sin(q)
            q += step * p
            p -= 0.5 * step * np.sin(q)
    q, p = (np.array(column).T.ravel() for column in zip(*rows))
    noise = random.normal(0.0, 0.005, (2, q.size))
    return pd.DataFrame(
        {
            "run": np.repeat(np.arange(1, runs + 1), samples),
            "t": np.tile(0.1 * np.arange(samples), runs),
            "q": q + noise[0],
            "p": p + noise[1],
        }
    )


@pytest.fixture(scope="module")
def spec() -> leverrier.Spec:
    return leverrier.parse(SPEC)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six files of whole runs, and what a cluster leaves beside them."""
    home = tmp_path_factory.mktemp("swings")
    table = swings()
    for at in range(6):
        part = table[(table.run - 1) // 4 == at]
        part.to_parquet(home / f"part-{at}.parquet", row_group_size=60)
    (home / "_SUCCESS").touch()
    (home / ".part-0.parquet.crc").write_bytes(b"x")
    return home


@pytest.fixture(scope="module")
def local(spec: leverrier.Spec, folder: Path) -> dict[str, Any]:
    law = parts.fit(spec, folder)
    assert [term.term for term in law.terms] == ["cos(q)"]
    assert law.data.samples == 24 * 60 and not law.data.warnings
    return law.model.to_dict()


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def test_the_law_is_that_of_all_rows_together(spec, local) -> None:
    (one,) = parts.fit(spec, [swings()]).model.to_dict()["terms"]
    (other,) = local["terms"]
    assert abs(one["coefficient"] - other["coefficient"]) < 1e-9
    assert abs(one["coefficient"] + 1.0) < 5 * one["standard_error"]


def test_three_functions_do_all_work_on_the_data(spec, folder) -> None:
    files = parts.files(folder)
    assert [os.path.basename(file) for file in files] == [f"part-{at}.parquet" for at in range(6)]
    surveys = [parts.survey(spec, file, at, samples=300) for at, file in enumerate(files)]
    assert all(survey.startswith(b"LVps") for survey in surveys)
    # What a table says, its file says.
    table = pd.read_parquet(files[2])
    here = parts.merge(parts.survey(spec, table, 0), parts.survey(spec, table, 1))
    assert here.startswith(b"LVps")

    class Kept(parts.Local):
        asked: list[tuple[bytes, list[bytes]]] = []

        def run(self, task, places, watch):
            given = [
                task(part, places[at] if places else (at, 0, 0, 0))
                for at, part in enumerate(self.parts)
            ]
            self.asked.append((places, given))
            return self.merged(given)

    engine = Kept(files)
    parts.fit(spec, None, engine=engine)
    (_, surveyed), *passes = engine.asked
    assert surveyed[0].startswith(b"LVps") and len(passes) > 1
    for places, given in passes:
        assert places == [(at, 4 * at, 240 * at, 0) for at in range(6)]
        # The size is that of the function space, whatever the number of samples.
        assert all(one.startswith(b"LVpf") and len(one) < 20_000 for one in given)
    with pytest.raises(leverrier.InvalidArgumentError, match="do not follow each other"):
        parts.merge(surveys[0], surveys[3])
    for wrong in [b"", b"LVps", surveys[0][:-7], surveys[0][:40] + b"\x00" + surveys[0][41:]]:
        with pytest.raises(leverrier.ModelError, match="these bytes are no"):
            parts.merge(wrong, surveys[1])
    with pytest.raises(leverrier.ModelError, match="no request for a pass"):
        parts.factor(spec, files[0], b"LVpq and nothing", (0, 0, 0, 0))


def test_two_processes_give_the_bits_of_one(spec, folder, client, local) -> None:
    told: list[float] = []
    law = parts.fit(spec, folder, engine=client, progress=lambda _, x: told.append(x))
    assert law.model.to_dict() == local
    assert told and all(0 <= x <= 1 for x in told)
    assert parts.fit(spec, str(folder / "*.parquet"), engine="dask").model.to_dict() == local


def test_a_dask_dataframe_is_read_where_it_is(spec, folder, client, local) -> None:
    dd = pytest.importorskip("dask.dataframe")
    frame = dd.read_parquet(parts.files(folder), split_row_groups=False)
    law = parts.fit(spec, frame)
    assert frame.npartitions == 6
    (one,), (other,) = law.model.to_dict()["terms"], local["terms"]
    assert abs(one["coefficient"] - other["coefficient"]) < 0.01 * other["standard_error"]
    # Columns by other names, and a run that goes on in the next partition.
    table = swings(runs=2, samples=600).rename(columns={"run": "swing", "t": "clock"})
    frame = dd.from_pandas(table, npartitions=3, sort=False)
    law = parts.fit(spec, frame, t="clock", run="swing")
    assert [term.term for term in law.terms] == ["cos(q)"]
    assert "go on from one part of the data to the next" in " ".join(law.data.warnings)
    assert law.model.evidence.runs == 2


@pytest.mark.skipif(os.name == "nt", reason="processes are killed by a signal")
def test_a_killed_worker_changes_nothing(spec, folder, client, local, tmp_path) -> None:
    from leverrier._dask import Dask

    mark = str(tmp_path / "died")

    def deadly(task: parts.Task) -> parts.Task:
        """A task whose worker dies in the middle of the pass, once."""

        def work(part: Any, place: parts.Place) -> bytes:
            import os
            import signal

            if place[0] == 3 and not os.path.exists(mark):
                open(mark, "x").close()
                os.kill(os.getpid(), signal.SIGKILL)
            return task(part, place)

        return work

    class Dying(Dask):
        passes = 0

        def run(self, task, places, watch):
            self.passes += 1
            return super().run(deadly(task) if self.passes == 2 else task, places, watch)

    before = set(client.run(os.getpid).values())
    engine = Dying(parts.files(folder), client, (None, None))
    law = parts.fit(spec, None, engine=engine)
    assert os.path.exists(mark) and engine.passes > 2
    client.wait_for_workers(2, timeout=300)
    assert set(client.run(os.getpid).values()) != before
    assert law.model.to_dict() == local


def test_damaged_parts_are_named(spec, folder, client, tmp_path) -> None:
    for file in parts.files(folder):
        shutil.copy(file, tmp_path)
    broken = tmp_path / "part-4.parquet"
    content = bytearray(broken.read_bytes())
    content[10:200] = b"\xff" * 190
    broken.write_bytes(content)
    for engine in [client, "local"]:
        with pytest.raises(leverrier.DataError, match="part-4.parquet.*is damaged") as raised:
            parts.fit(spec, tmp_path, engine=engine)
        assert raised.value.file.endswith("part-4.parquet")
        assert raised.value.row_group == 1
    tables = [swings(4, 30), swings(4, 30).assign(q="wide")]
    with pytest.raises(leverrier.DataError, match="in part 1 of the data"):
        parts.fit(spec, tables)


def test_what_is_no_part_is_said(spec, folder, tmp_path) -> None:
    with pytest.raises(leverrier.InvalidArgumentError, match="no files of data"):
        parts.fit(spec, tmp_path)
    with pytest.raises(leverrier.InvalidArgumentError, match="no list of parts"):
        parts.fit(spec, 3.5)
    with pytest.raises(leverrier.InvalidArgumentError, match="does not go with"):
        parts.fit(spec, folder, engine="abacus")
    with pytest.raises(RuntimeError, match="out of order"):
        parts.fit(spec, None, engine=_Broken())
    with pytest.raises(KeyboardInterrupt):
        parts.fit(spec, None, engine=_Endless(), progress=_interrupting)


class _Broken(parts.Engine):
    def run(self, task, places, watch):
        raise RuntimeError("out of order")


class _Endless(parts.Engine):
    def run(self, task, places, watch):
        while watch(0.0):
            time.sleep(0.01)


def _interrupting(stage: str, fraction: float) -> None:
    raise KeyboardInterrupt


def test_empty_tables_are_parts_without_rows(spec, local) -> None:
    table = swings()
    half = len(table) // 2
    law = parts.fit(spec, [table[:half], table[:0], table[half:]])
    assert [term.term for term in law.terms] == ["cos(q)"]
    assert law.data.samples == len(table)


@pytest.fixture(scope="module")
def spark() -> Iterator[Any]:
    sql = pytest.importorskip("pyspark.sql")
    if shutil.which("java") is None:
        pytest.skip("there is no Java")
    # Its workers are to be of this environment.
    os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
    session = (
        sql.SparkSession.builder.master("local[2]")
        .config("spark.ui.enabled", "false")
        .config("spark.driver.bindAddress", "127.0.0.1")
        .config("spark.driver.host", "127.0.0.1")
        .getOrCreate()
    )
    yield session
    session.stop()


def test_spark_gives_the_same_bits(spec, folder, spark, local, tmp_path) -> None:
    assert parts.fit(spec, folder, engine=spark).model.to_dict() == local
    frame = spark.createDataFrame(swings()).repartitionByRange(3, "run")
    frame = frame.sortWithinPartitions("run", "t")
    law = parts.fit(spec, frame)
    (one,), (other,) = law.model.to_dict()["terms"], local["terms"]
    assert abs(one["coefficient"] - other["coefficient"]) < 0.05 * other["standard_error"]
    shutil.copy(parts.files(folder)[0], tmp_path)
    (tmp_path / "x.parquet").write_bytes(b"PAR1 is all")
    with pytest.raises(leverrier.DataError, match="x.parquet: the file is cut off"):
        parts.fit(spec, tmp_path, engine="spark")
