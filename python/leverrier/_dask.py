"""Passes over data on a cluster of Dask."""

from __future__ import annotations

import threading
import uuid
from typing import Any

from .distributed import Columns, Engine, Place, Task, Watch, merge, tree
from .errors import InvalidArgumentError

#: How often the cluster is asked how far it has come, in seconds.
_INTERVAL = 0.1


class Dask(Engine):
    """Parts that Dask's workers read: files, tables, or the partitions of a dataframe.

    A pass is one graph: a task for each part, and merges in a tree above them. What a worker that
    dies had done is done again elsewhere, by Dask's own bookkeeping.
    """

    def __init__(self, parts: Any, client: Any, columns: tuple[str | None, str | None]) -> None:
        self._client = client if client is not None else _running()
        self._parts = parts
        self._columns = columns

    def run(self, task: Task, places: list[Place] | None, watch: Watch) -> bytes | None:
        import dask

        name = f"leverrier-{uuid.uuid4().hex[:12]}"
        leaves = [
            dask.delayed(_called, pure=False)(
                task, part, places[at] if places else (at, 0, 0, 0), self._columns,
                dask_key_name=f"{name}-part-{at}",
            )
            for at, part in enumerate(self._delayed())
        ]  # fmt: skip
        joined = iter(range(len(leaves)))

        def join(first: Any, second: Any) -> Any:
            key = f"{name}-merge-{next(joined)}"
            return dask.delayed(merge, pure=False)(first, second, dask_key_name=key)

        root = tree(leaves, join)
        root, *leaves = self._client.compute([root, *leaves])
        count = len(leaves)
        try:
            done = threading.Event()
            root.add_done_callback(lambda _: done.set())
            while not done.wait(_INTERVAL):
                # What was merged need not be kept; of what failed the first is told.
                leaves = [leaf for leaf in leaves if leaf.status != "finished"]
                if not watch(1 - len(leaves) / count):
                    return None
            for leaf in leaves:
                if leaf.status == "error":
                    leaf.result()
            return root.result()
        finally:
            # What nobody waits for any more is not done.
            for future in [root, *leaves]:
                future.release()

    def _delayed(self) -> list[Any]:
        """The parts; what is a table travels to a worker in every pass."""
        if hasattr(self._parts, "to_delayed"):
            return list(self._parts.to_delayed())
        return list(self._parts)


def _called(task: Task, part: Any, place: Place, columns: tuple[str | None, str | None]) -> bytes:
    if not isinstance(part, (str, Columns)) and any(name is not None for name in columns):
        part = Columns(part, *columns)
    return task(part, place)


def _running() -> Any:
    try:
        import distributed
    except ImportError:
        raise InvalidArgumentError(
            "Dask's scheduler is not installed", "pip install 'dask[distributed]'"
        ) from None
    try:
        return distributed.get_client()
    except ValueError:
        raise InvalidArgumentError(
            "no client of Dask is running",
            "start one, `distributed.Client(n_workers=2)`, or give it as engine=",
        ) from None
