"""Fits to data in many parts, on engines that exist: Dask, Spark, or this process.

A fit passes over the data a few times, and a pass leaves triangular factors that merge. Three pure
functions do all work on the data: :func:`survey` of a part, the :func:`factor` of a part at given
numbers, and the :func:`merge` of two neighbours. :func:`fit` calls them where the parts are, and
keeps the search for the terms to itself.

>>> import leverrier
>>> from leverrier import distributed
>>> spec = leverrier.open("examples/damped-pendulum/fit.ham")
>>> swings = "examples/damped-pendulum/swings.csv"
>>> law = distributed.fit(spec, [swings, swings])
>>> [term.term for term in law.terms]
['cos(q)']

What is made where: the surveys and every pass over all data by the workers, the refits' among them;
the first look at a sample, the search for the terms on the factors, and all that is said of the
result here. Comparisons and diagnoses are not distributed: ``law.diagnose()`` works on the sample,
``law.data``, which is about 65,000 samples of whole runs (stretches of long ones), drawn at random.
"""

from __future__ import annotations

import functools
import glob
import os
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from . import _native, tables
from .errors import InvalidArgumentError, LeverrierError
from .law import Law
from .progress import Progress, finished
from .spec import Spec, fit_options, parse, threads_of
from .tables import Data

if TYPE_CHECKING:
    from typing import TypeAlias

__all__ = ["Engine", "Local", "factor", "fit", "merge", "survey"]

#: Number of a part, runs and samples in the parts before it, and how many of these samples are of
#: the run that goes on in it.
Place: TypeAlias = "tuple[int, int, int, int]"
#: What is told how far a pass has come (0 to 1), and gives whether to go on.
Watch: TypeAlias = "Callable[[float], bool]"
#: Work on one part: takes it and its place, gives bytes.
Task: TypeAlias = "Callable[[Any, Place], bytes]"

#: Samples that a survey keeps, about, unless another number is given.
SAMPLES = 1 << 16


def survey(
    spec: Spec,
    part: Any,
    number: int,
    *,
    samples: int = SAMPLES,
    seed: int = 0,
    threads: int | None = 1,
) -> bytes:
    """The survey of a part of the data: counts, moments, the ends of its runs, and a fair sample.

    ``part`` is the name of a file, a table with named columns, or :class:`leverrier.Data`;
    ``number`` counts the parts from 0. Surveys :func:`merge`.

    >>> import leverrier
    >>> spec = leverrier.open("examples/damped-pendulum/fit.ham")
    >>> first = survey(spec, "examples/damped-pendulum/swings.csv", 0, samples=500)
    >>> first[:4]
    b'LVps'
    """
    native = _native_part(spec, part, number)
    sampling = (tables._seed(samples), tables._seed(seed))
    return _native.survey_part(spec._native, native, _number(number), sampling, threads_of(threads))


def factor(
    spec: Spec, part: Any, request: bytes, place: Place, *, threads: int | None = 1
) -> bytes:
    """The pass of a part at the numbers of a request: triangular factors, as bytes.

    ``request`` is what a fit asks its :class:`Engine` for; ``place`` says which part this is,
    how many runs and samples stand in the parts before it, and how many of these samples are of a
    run that goes on in it. Factors of one request :func:`merge`.
    The bytes do not depend on ``threads``.
    """
    number, *counts = place
    native = _native_part(spec, part, number)
    runs, samples, carried = (tables._seed(count) for count in counts)
    place = (_number(number), runs, samples, carried)
    return _native.pass_part(spec._native, native, bytes(request), place, threads_of(threads))


def merge(first: bytes, second: bytes) -> bytes:
    """Two surveys, or two factors, of which the second is of the parts that follow, as one.

    >>> import leverrier
    >>> spec = leverrier.open("examples/damped-pendulum/fit.ham")
    >>> parts = [survey(spec, "examples/damped-pendulum/swings.csv", at) for at in range(2)]
    >>> merge(*parts)[:4]
    b'LVps'
    >>> try:
    ...     merge(parts[0], parts[1][:-1])
    ... except leverrier.ModelError as error:
    ...     print(error)
    these bytes are no survey of a part of the data: they were damaged on the way; hand on what the functions for parts of the data gave, as it is
    """
    return _native.merge_parts(bytes(first), bytes(second))


def fit(
    spec: Spec,
    parts: Any,
    *,
    engine: Any = None,
    t: str | None = None,
    run: str | None = None,
    worker_threads: int = 1,
    select: str = "information",
    loss: str = "squares",
    method: str | None = None,
    step: float | None = None,
    window: int | None = None,
    starts: int = 8,
    seed: int = 0,
    sparse: bool = True,
    trainer: str = "gauss-newton",
    memory: int | str | None = None,
    threads: int | None = None,
    progress: bool | Progress | None = None,
) -> Law:
    """Learns from data in many parts which terms the law has, and their coefficients.

    ``parts`` is a folder of files or a pattern (``"swings/*.parquet"``; in the order of their
    names), a list of files or of tables, a Dask dataframe, or a Spark one; ``t`` and ``run`` name
    columns of tables in place of those of the spec's ``data`` line. ``engine`` is a
    ``distributed.Client`` or a ``SparkSession``, ``"dask"`` or ``"spark"`` for the one that is
    running, ``"local"`` for this process, or an :class:`Engine`; without it dataframes go to the
    engine that they are of, and other parts to this process.

    Each worker uses ``worker_threads``; ``threads`` are those of the search here. Rows of a run
    stand together, in the order of time. A run whose name and times go on in the next part is one
    run, its segment at the border cut in two; ``law.data.warnings`` tells of it.

    The law has the same bits for any number of workers, and whatever dies on the way. To that of
    one file with all rows it is equal where there is one part; with several the sample is drawn
    otherwise: where it leads to segments of the same length and to the same integrator, coefficients
    agree within a few hundredths of their standard errors, else within a part of them.

    >>> import leverrier
    >>> from leverrier import distributed
    >>> spec = leverrier.open("examples/damped-pendulum/fit.ham")
    >>> law = distributed.fit(spec, ["examples/damped-pendulum/swings.csv"])
    >>> law.data.samples
    968
    """
    options = fit_options(
        select=select, loss=loss, method=method, step=step, window=window, starts=starts,
        seed=seed, sparse=sparse, trainer=trainer, memory=memory,
    )  # fmt: skip
    found = _engine(engine, parts, (t, run))
    asked = _Asked(found, spec.text, threads_of(worker_threads))

    def wrapped(native: tuple[_native.Law, _native.Data]) -> Law:
        sample = Data(native[1], spec, ("file",) if tables._is_kept(spec) else None)
        return Law(native[0], spec, sample)

    def work(told: Progress | None) -> tuple[_native.Law, _native.Data]:
        return _native.fit_parts(spec._native, asked, options, threads_of(threads), told)

    return finished(progress, work, wrapped)


class Engine:
    """Whoever has the parts of the data, and can call functions where they are.

    An engine of one's own has the method :meth:`run`:

    >>> from concurrent.futures import ThreadPoolExecutor
    >>> import leverrier
    >>> from leverrier import distributed
    >>> class Threads(distributed.Engine):
    ...     def __init__(self, files):
    ...         self.files = files
    ...     def run(self, task, places, watch):
    ...         with ThreadPoolExecutor(2) as pool:
    ...             places = places or [(at, 0, 0, 0) for at in range(len(self.files))]
    ...             return self.merged(list(pool.map(task, self.files, places)))
    >>> spec = leverrier.open("examples/damped-pendulum/fit.ham")
    >>> swings = "examples/damped-pendulum/swings.csv"
    >>> law = distributed.fit(spec, None, engine=Threads([swings, swings]))
    >>> len(law.terms)
    1
    """

    def run(self, task: Task, places: list[Place] | None, watch: Watch) -> bytes | None:
        """Calls ``task(part, place)`` for every part, wherever it is, and merges what they give, as
        :meth:`merged` does. ``places`` is None where nothing is known of the parts yet: then each
        stands at ``(number, 0, 0, 0)``. The task pickles.

        ``watch`` takes how far it has come (0 to 1) and gives whether to go on; where it says no,
        None is the answer.
        """
        raise NotImplementedError

    @staticmethod
    def merged(leaves: Sequence[bytes]) -> bytes:
        """What the parts gave, in their order, as one: neighbours first, then neighbours of those;
        an odd last one goes up as it is. The tree depends on the number of parts alone."""
        return tree(leaves, merge)


def tree(leaves: Sequence[Any], join: Callable[[Any, Any], Any]) -> Any:
    """Merges neighbours until one is left."""
    level = list(leaves)
    if not level:
        raise InvalidArgumentError("the data have no parts", "name at least one file or table")
    while len(level) > 1:
        above = [join(level[at], level[at + 1]) for at in range(0, len(level) - 1, 2)]
        level = above + level[len(above) * 2 :]
    return level[0]


class Local(Engine):
    """This process, part after part.

    >>> Local(["a.parquet", "b.parquet"])
    <leverrier.distributed.Local: 2 parts>
    """

    def __init__(self, parts: Iterable[Any]) -> None:
        self.parts = list(parts)

    def run(self, task: Task, places: list[Place] | None, watch: Watch) -> bytes | None:
        leaves = []
        for at, part in enumerate(self.parts):
            if not watch(at / len(self.parts)):
                return None
            leaves.append(task(part, places[at] if places else (at, 0, 0, 0)))
        return self.merged(leaves)

    def __repr__(self) -> str:
        return f"<leverrier.distributed.Local: {len(self.parts)} parts>"


class _Asked:
    """What the fit calls: an engine, and what its tasks are of."""

    def __init__(self, engine: Engine, text: str, threads: int | None) -> None:
        self.engine = engine
        self.text = text
        self.threads = threads

    def survey(self, samples: int, seed: int, watch: Watch) -> bytes | None:
        task = functools.partial(_surveyed, self.text, samples, seed, self.threads)
        return self.engine.run(task, None, watch)

    def pass_(self, request: bytes, places: list[Place], watch: Watch) -> bytes | None:
        task = functools.partial(_passed, self.text, request, self.threads)
        return self.engine.run(task, places, watch)


@functools.lru_cache(maxsize=8)
def _spec(text: str) -> Spec:
    """A spec, compiled once in every worker."""
    return parse(text)


def _surveyed(
    text: str, samples: int, seed: int, threads: int | None, part: Any, place: Place
) -> bytes:
    return survey(_spec(text), part, place[0], samples=samples, seed=seed, threads=threads)


def _passed(text: str, request: bytes, threads: int | None, part: Any, place: Place) -> bytes:
    return factor(_spec(text), part, request, place, threads=threads)


class Columns:
    """A table whose times and runs stand in columns that the user named."""

    def __init__(self, table: Any, t: str | None, run: str | None) -> None:
        self.table, self.t, self.run = table, t, run


def _native_part(spec: Spec, part: Any, number: int) -> Any:
    """A part as the library takes it: the name of a file, or measurements."""
    if isinstance(part, (str, os.PathLike)):
        return tables.path_text(part)
    if not isinstance(part, Columns):
        part = Columns(part, None, None)
    table = part.table
    if not isinstance(table, Data) and hasattr(table, "__len__") and len(table) == 0:
        return _native.Data.empty(spec._native)
    try:
        return spec.data(table, t=part.t, run=part.run)._native
    except LeverrierError as error:
        error.message = f"in part {number} of the data: {error.message}"
        raise


def _number(number: Any) -> int:
    number = tables._seed(number)
    if number >= 1 << 22:
        raise InvalidArgumentError(f"{number} is no number of a part", "at most 4 million parts")
    return number


def files(parts: str | os.PathLike[str]) -> list[str]:
    """The files of a folder or of a pattern, in the order of their names; those that begin with a
    dot or an underscore are none of the data."""
    text = tables.path_text(parts)
    if os.path.isfile(text):
        return [text]
    within = os.path.join(glob.escape(text), "*") if os.path.isdir(text) else text
    found = sorted(path for path in glob.glob(within) if os.path.isfile(path))
    found = [path for path in found if not os.path.basename(path).startswith((".", "_"))]
    if not found:
        raise InvalidArgumentError(
            f"there are no files of data in {text}", "name a folder, a pattern, or a list of files"
        )
    return found


def _engine(engine: Any, parts: Any, columns: tuple[str | None, str | None]) -> Engine:
    if isinstance(engine, Engine):
        return engine
    if isinstance(parts, (str, os.PathLike)):
        parts = files(parts)
    module = type(engine).__module__.split(".")[0]
    wanted = engine if isinstance(engine, str) else module if engine is not None else None
    is_dask = hasattr(parts, "to_delayed")
    is_spark = hasattr(parts, "mapInArrow")
    if wanted is None:
        wanted = "dask" if is_dask else "spark" if is_spark else "local"
    client = None if isinstance(engine, str) else engine
    if not (is_dask or is_spark):
        if not isinstance(parts, Sequence) or not parts:
            raise InvalidArgumentError(
                f"a {type(parts).__name__} is no list of parts",
                "give a folder, a list of files or tables, or a dataframe of Dask or Spark",
            )
        if any(column is not None for column in columns):
            parts = [
                part if isinstance(part, (str, os.PathLike)) else Columns(part, *columns)
                for part in parts
            ]
    if wanted in ("dask", "distributed") and not is_spark:
        from ._dask import Dask

        return Dask(parts, client, columns)
    if wanted in ("spark", "pyspark") and not is_dask:
        from ._spark import Spark

        return Spark(parts, client, columns)
    if wanted == "local" and not (is_dask or is_spark):
        return Local(parts)
    raise InvalidArgumentError(
        f"the engine {engine!r} does not go with a {type(parts).__name__}",
        "give a client of Dask, a session of Spark, `local`, or leave it out",
    )
