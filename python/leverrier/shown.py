"""How results are shown: tables as text and for notebooks, numbers with the digits that count."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

import numpy as np


def short(value: Any) -> str:
    """A value in a cell."""
    if isinstance(value, (bool, np.bool_)) or value is None:
        return "" if value is None else str(value).lower()
    if isinstance(value, (float, np.floating)):
        return f"{value:.6g}"
    if isinstance(value, (list, tuple)) and value and len(value) <= 6:
        return ", ".join(short(one) for one in value)
    if isinstance(value, (list, tuple)):
        return f"{len(value)} entries" if value else ""
    text = str(value)
    return text if len(text) <= 120 else text[:117] + "..."


def p_value_text(p: float) -> str:
    """A p-value: two digits, and no more than that it is far below all that chance does."""
    return "< 1e-12" if p < 1e-12 else f"{p:.1e}"


def with_error(value: float | None, error: float | None) -> tuple[str, str]:
    """A number and its standard error, both to two digits of the error.

    >>> with_error(-0.99593461, 0.00236534)
    ('-0.9959', '0.0024')
    >>> with_error(8177.3, 25.0), with_error(0.5, None), with_error(0.5, 0.0)
    (('8177', '25'), ('0.5', ''), ('0.5', '0'))
    """
    if value is None:
        return "", ""
    if error is None or not np.isfinite(error) or error <= 0:
        return f"{value:.6g}", "" if error is None else f"{error:g}"
    digits = 1 - int(np.floor(np.log10(error)))
    if abs(value) >= 1e7 or digits > 10:
        return f"{value:.10g}", f"{error:.1e}"
    return f"{value:.{max(digits, 0)}f}", f"{error:.{max(digits, 0)}f}"


def text_table(names: Sequence[str], rows: Sequence[Sequence[str]], most: int = 20) -> str:
    """A table as text: numbers to the right, words to the left.

    >>> print(text_table(["term", "value"], [["q^2", "0.5"], ["cos(q)", "-10"]]))
    term    value
    q^2       0.5
    cos(q)    -10
    """
    shown = [[str(cell).replace("\n", " ") for cell in row] for row in rows[:most]]
    right = [bool(shown) and all(_is_number(row[at]) for row in shown) for at in range(len(names))]
    widths = [max(len(row[at]) for row in [list(names), *shown]) for at in range(len(names))]

    def line(cells: Sequence[str]) -> str:
        parts = [
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(cells, widths, right)
        ]
        return "  ".join(parts).rstrip()

    lines = [line(names), *(line(row) for row in shown)]
    if len(rows) > most:
        lines.append(f"... and {len(rows) - most} more")
    return "\n".join(lines)


def _is_number(cell: str) -> bool:
    try:
        float(cell or "0")
    except ValueError:
        return False
    return True


def html_table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table for a notebook."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(str(cell))}</td>" for cell in row) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def in_html(latex: str) -> str:
    """Equations for a notebook, which sets what stands between dollars."""
    return f"<div>{html.escape(latex, quote=False)}</div>"
