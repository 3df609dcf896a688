"""Passes over data on a cluster of Spark."""

from __future__ import annotations

import pickle
import threading
import uuid
from collections.abc import Callable, Iterator
from typing import Any

from .distributed import Columns, Engine, Place, Task, Watch
from .errors import InvalidArgumentError, LeverrierError

#: How often the fit is asked whether to go on, in seconds.
_INTERVAL = 0.1
#: What comes back of every part: its number, and bytes or the exception that it raised.
_SCHEMA = "number int, given binary, raised binary"


class Spark(Engine):
    """Parts that Spark's executors read: files, or the partitions of a dataframe.

    A pass is one ``mapInArrow``; what the parts give comes here and is merged here.
    """

    def __init__(self, parts: Any, session: Any, columns: tuple[str | None, str | None]) -> None:
        self._session = session if session is not None else _running(parts)
        self._parts = parts
        self._columns = columns

    def run(self, task: Task, places: list[Place] | None, watch: Watch) -> bytes | None:
        if hasattr(self._parts, "mapInArrow"):
            frame, count = self._parts, None
            work = _of_partition(task, places, self._columns)
        else:
            count = len(self._parts)
            rows = [(at, pickle.dumps(part)) for at, part in enumerate(self._parts)]
            frame = self._session.createDataFrame(rows, "number int, part binary")
            frame = frame.repartitionByRange(count, "number")
            work = _of_row(task, places)
        found = self._collected(frame.mapInArrow(work, _SCHEMA), watch)
        if found is None:
            return None
        given: dict[int, bytes] = {}
        for row in sorted(found, key=lambda row: row["number"]):
            if row["raised"] is not None:
                raise pickle.loads(bytes(row["raised"]))
            given[row["number"]] = bytes(row["given"])
        # Spark does not ask for partitions without rows.
        known = len(places) if places else max(given, default=-1) + 1
        for at in range(count or known):
            if at not in given:
                given[at] = task([], places[at] if places else (at, 0, 0, 0))
        return self.merged([given[at] for at in sorted(given)])

    def _collected(self, frame: Any, watch: Watch) -> list[Any] | None:
        tag = f"leverrier-{uuid.uuid4().hex[:12]}"
        answer: list[Any] = []
        done = threading.Event()

        def collect() -> None:
            try:
                self._session.addTag(tag)
                answer.append(frame.collect())
            except BaseException as error:
                answer.append(error)
            finally:
                done.set()

        threading.Thread(target=collect, daemon=True).start()
        while not done.wait(_INTERVAL):
            if not watch(0.0):
                self._session.interruptTag(tag)
                return None
        if isinstance(answer[0], BaseException):
            raise answer[0]
        return answer[0]


def _batch(number: int, work: Callable[[], bytes]) -> Any:
    """The one row that a part gives."""
    import pyarrow

    given, raised = None, None
    try:
        given = work()
    except LeverrierError as error:
        raised = pickle.dumps(error)
    columns = [
        pyarrow.array([number], pyarrow.int32()),
        pyarrow.array([given], pyarrow.binary()),
        pyarrow.array([raised], pyarrow.binary()),
    ]
    return pyarrow.RecordBatch.from_arrays(columns, ["number", "given", "raised"])


def _of_partition(
    task: Task, places: list[Place] | None, names: tuple[str | None, str | None]
) -> Callable[[Iterator[Any]], Iterator[Any]]:
    def work(batches: Iterator[Any]) -> Iterator[Any]:
        import pyarrow
        from pyspark import TaskContext

        rows = list(batches)
        if rows:
            number = TaskContext.get().partitionId()
            table = Columns(pyarrow.Table.from_batches(rows), *names)
            place = places[number] if places else (number, 0, 0, 0)
            yield _batch(number, lambda: task(table, place))

    return work


def _of_row(
    task: Task, places: list[Place] | None
) -> Callable[[Iterator[Any]], Iterator[Any]]:
    def work(batches: Iterator[Any]) -> Iterator[Any]:
        for batch in batches:
            for row in batch.to_pylist():
                number, part = row["number"], pickle.loads(row["part"])
                place = places[number] if places else (number, 0, 0, 0)
                yield _batch(number, lambda part=part, place=place: task(part, place))

    return work


def _running(parts: Any) -> Any:
    session = getattr(parts, "sparkSession", None)
    if session is None:
        try:
            from pyspark.sql import SparkSession
        except ImportError:
            raise InvalidArgumentError(
                "Spark is not installed", "pip install 'pyspark[sql]'"
            ) from None
        session = SparkSession.getActiveSession()
    if session is None:
        raise InvalidArgumentError(
            "no session of Spark is running",
            "start one, `SparkSession.builder.getOrCreate()`, or give it as engine=",
        )
    return session
