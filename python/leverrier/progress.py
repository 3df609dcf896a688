"""Progress of long work through tqdm, where it is installed."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from .errors import InvalidArgumentError

#: Takes a few words about the present stage and how far the whole has come (0 to 1).
Progress = Callable[[str, float], object]

#: Shorter work shows nothing, in seconds.
PATIENCE = 1.0


Raw = TypeVar("Raw")
Result = TypeVar("Result")


def finished(
    progress: bool | Progress | None,
    work: Callable[[Progress | None], Raw],
    wrapped: Callable[[Raw], Result],
    cut_short: Callable[[Raw], Result] | None = None,
) -> Result:
    """What long work gives, wrapped. Where Ctrl-C ends it, so is the best so far that it leaves in
    the attribute ``best`` of KeyboardInterrupt, by ``cut_short`` where that is given."""
    try:
        with shown(progress) as told:
            raw = work(told)
    except KeyboardInterrupt as interrupt:
        if hasattr(interrupt, "best"):
            interrupt.best = (cut_short or wrapped)(interrupt.best)
        raise
    return wrapped(raw)


@contextmanager
def shown(progress: bool | Progress | None) -> Iterator[Progress | None]:
    """What is told how far the work has come: the caller's own function, a bar of tqdm (None: in
    notebooks and terminals, for what takes over a second), or nothing (False)."""
    if callable(progress):
        yield progress
        return
    if not (progress is None or isinstance(progress, bool)):
        raise InvalidArgumentError(
            f"progress is {progress!r}", "give a function, True, False, or leave it out"
        )
    bar = _bar() if progress or (progress is None and _is_watched()) else None
    if bar is None:
        yield None
        return
    made: list[Any] = []
    start = time.monotonic()

    def tell(stage: str, fraction: float) -> None:
        if not made:
            if progress is None and time.monotonic() - start < PATIENCE:
                return
            made.append(bar(total=100, leave=False, bar_format="{l_bar}{bar}| {elapsed}"))
        made[0].set_description(stage)
        made[0].update(round(100 * fraction) - made[0].n)

    try:
        yield tell
    finally:
        for one in made:
            one.close()


def _bar() -> Any:
    try:
        with warnings.catch_warnings():
            # A notebook without widgets gets a bar of text, which is no reason to warn.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm


def _is_watched() -> bool:
    return "ipykernel" in sys.modules or sys.stderr is not None and sys.stderr.isatty()
