"""The catalogue of physical effects, as the program has it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from typing import TYPE_CHECKING, cast

from .errors import InvalidArgumentError, LeverrierError, NoResultError
from .results import Record, Rows
from .tables import path_text

if TYPE_CHECKING:
    from .spec import Spec

#: Longer than this the program does not take to print a list, in seconds.
_PATIENCE = 60.0


def effects(
    name: str | None = None, *, program: str | os.PathLike[str] = "leverrier"
) -> Rows | Record:
    """The physical effects that a diagnosis tries, one a row: ``name``, ``kind``, ``formula``,
    ``physics``, ``telltale``, ``reference`` and more; with a ``name`` that one as a record.

    The list is that of the program ``leverrier``, which must be installed beside this package;
    ``program`` says where, if it is not on the path. ``law.effects()`` has those that a law takes.

    Raises :class:`leverrier.NoResultError` where there is no program, and
    :class:`leverrier.InvalidArgumentError` for a name that it does not know.
    """
    found = shutil.which(path_text(program))
    if found is None:
        raise NoResultError(
            f"the catalogue is that of the program, and there is no `{os.fspath(program)}`",
            "install it by `cargo install --path .`, or say program= with its path; "
            "`law.diagnose()` tries all effects without it",
            kind="NoProgram",
        )
    words = [found, "effects", *([] if name is None else [str(name)]), "--format", "json"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=_PATIENCE, check=False)
        told = json.loads(done.stdout or done.stderr)
    except (OSError, subprocess.SubprocessError, ValueError) as error:
        raise NoResultError(
            f"`{found} effects` lists no effects ({error})",
            "say program= with the path of leverrier",
        ) from error
    if done.returncode != 0:
        raise InvalidArgumentError(told.get("message", "the program failed"), told.get("hint"))
    if name is not None:
        return Record(told["effect"])
    return Rows(Record(one) for one in told["effects"])


def taken_by(spec: Spec, program: str | os.PathLike[str]) -> Rows:
    """The effects that a spec takes, each once for every place where it may stand."""
    rows: list[Record] = []
    for one in cast("Rows", effects(program=program)):
        for effect in _places(spec, one.name):
            rows.append(Record({"effect": effect, "kind": one.kind, "physics": one.physics}))
    return Rows(rows)


def _places(spec: Spec, name: str) -> list[str]:
    """Names of an effect as ``add`` takes them; none where it does not apply."""
    try:
        spec.with_effect(name)
    except LeverrierError as error:
        if error.kind != "Ambiguous":
            return []
        # The library lists the places: `viscous_drag(x), viscous_drag(y)`.
        listed = (error.hint or error.message).rpartition("say which: ")[2]
        return [place if place.endswith(")") else f"{place})" for place in listed.split("), ")]
    return [name]
