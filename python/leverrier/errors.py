"""What can go wrong, as a small tree of exceptions.

Each has a ``message`` (what is wrong), a ``hint`` (what to do about it, or None), a ``kind`` (the
case in a word), and the place where there is one: ``file``, ``line``, ``column``, ``span``.

>>> import leverrier
>>> try:
...     leverrier.parse("coordinates q; momenta p\\nT = p^2/2\\nV = foo")
... except leverrier.SpecError as error:
...     print(error.line, error.column, error.span)
3 5 (39, 42)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = [
    "DataError",
    "Diagnostic",
    "FileError",
    "InvalidArgumentError",
    "LeverrierError",
    "LeverrierWarning",
    "ModelError",
    "NoResultError",
    "SpecError",
]


@dataclass(frozen=True)
class Diagnostic:
    """One message about the text of a spec; ``line`` and ``column`` count from 1, ``span`` is in
    bytes of the text."""

    severity: str
    message: str
    label: str
    hint: str | None
    line: int
    column: int
    span: tuple[int, int]


class LeverrierError(Exception):
    """Whatever this package says no to."""

    def __init__(
        self,
        message: str,
        hint: str | None = None,
        *,
        kind: str = "InvalidArgument",
        file: str | None = None,
        line: int | None = None,
        column: int | str | None = None,
        row_group: int | None = None,
        diagnostics: tuple[Diagnostic, ...] = (),
        text: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        #: What to do about it.
        self.hint = hint
        #: The case in a word, such as ``"InsufficientData"``.
        self.kind = kind
        #: The file that it is about.
        self.file = file
        #: Line of a spec or of a text file, row of a table; counted from 1.
        self.line = line
        #: Column of a spec, counted from 1; name of the column of a table.
        self.column = column
        #: Row group of a Parquet file, counted from 1.
        self.row_group = row_group
        #: All that is wrong with a spec, in the order of its text.
        self.diagnostics = diagnostics
        self._text = text

    @property
    def span(self) -> tuple[int, int] | None:
        """The place in the text of a spec, in bytes, end excluded."""
        return self.diagnostics[0].span if self.diagnostics else None

    def __str__(self) -> str:
        hint = f"; {self.hint}" if self.hint else ""
        return f"{self._place()}{self.message}{hint}"

    def _place(self) -> str:
        parts = [self.file] if self.file and self.file not in self.message else []
        if self.line is not None:
            parts.append(f"{'line' if self.file and not self.row_group else 'row'} {self.line}")
        if self.row_group is not None:
            parts.append(f"row group {self.row_group}")
        if self.column is not None:
            parts.append(f"column `{self.column}`")
        return ", ".join(parts) + ": " if parts else ""

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (type(self), self.__dict__)


def _again(cls: type[LeverrierError], fields: dict[str, Any]) -> LeverrierError:
    error = cls(fields["message"])
    error.__dict__.update(fields)
    return error


class LeverrierWarning(UserWarning):
    """What deserves a look: a result that is not what it seems, or that was taken for granted."""


class SpecError(LeverrierError, ValueError):
    """The text of a spec is wrong; ``diagnostics`` has all that is."""

    def __str__(self) -> str:
        if not self.diagnostics or self._text is None:
            return super().__str__()
        return "\n".join(self._shown(one) for one in self.diagnostics)

    def _shown(self, one: Diagnostic) -> str:
        lines = (self._text or "").split("\n")
        line = lines[one.line - 1].replace("\t", " ") if one.line <= len(lines) else ""
        length = len((self._text or "").encode()[slice(*one.span)].decode(errors="replace"))
        mark = " " * (one.column - 1) + "^" * max(1, min(length, len(line) - one.column + 1))
        hint = f"\n  {one.hint}" if one.hint else ""
        where = f"{self.file}, " if self.file else ""
        return f"{where}line {one.line}: {one.message}\n  {line}\n  {mark} {one.label}{hint}"


class DataError(LeverrierError, ValueError):
    """Measurements cannot be used as they are, or do not suffice."""


class InvalidArgumentError(LeverrierError, ValueError):
    """A value out of its range, values that do not go together, or a name that is not known."""


class ModelError(LeverrierError, ValueError):
    """A model is damaged, of another version, or belongs to another spec."""


class FileError(LeverrierError, OSError):
    """The operating system refused to read, write or create a file."""


class NoResultError(LeverrierError, RuntimeError):
    """The work ended without a result: nothing found, too little memory, a motion that leaves the
    finite numbers."""


_CLASSES: dict[str, type[LeverrierError]] = {
    "Spec": SpecError,
    "Data": DataError,
    "InsufficientData": DataError,
    "NotIdentifiable": DataError,
    "Model": ModelError,
    "File": FileError,
    "AlreadyExists": FileError,
    "UnknownName": InvalidArgumentError,
    "Ambiguous": InvalidArgumentError,
    "InvalidArgument": InvalidArgumentError,
    "NotApplicable": InvalidArgumentError,
    "NothingToDo": InvalidArgumentError,
    "DataNotNamed": InvalidArgumentError,
}


def from_native(fields: dict[str, Any]) -> LeverrierError:
    """The exception for an error of the library: its class follows from the kind."""
    diagnostics = tuple(Diagnostic(**one) for one in fields.get("diagnostics", ()))
    line, column = fields.get("line"), fields.get("column")
    if diagnostics:
        line, column = diagnostics[0].line, diagnostics[0].column
    return _CLASSES.get(fields["kind"], NoResultError)(
        fields["message"],
        fields.get("hint"),
        kind=fields["kind"],
        file=fields.get("file"),
        line=line,
        column=column,
        row_group=fields.get("row_group"),
        diagnostics=diagnostics,
        text=fields.get("text"),
    )
