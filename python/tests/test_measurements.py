"""Measurements from whatever holds them, and measurements that cannot be used."""

import sys

import numpy as np
import pytest

import leverrier
from leverrier import DataError, InvalidArgumentError

FILE = "examples/damped-pendulum/swings.csv"
SPEC = "examples/damped-pendulum/fit.ham"


def as_pandas():
    return pytest.importorskip("pandas").read_csv(FILE)


def as_polars():
    return pytest.importorskip("polars").read_csv(FILE)


def as_polars_lazily():
    return pytest.importorskip("polars").scan_csv(FILE)


def as_pyarrow():
    return pytest.importorskip("pyarrow.csv").read_csv(FILE)


def as_a_stream():
    table = as_pyarrow()

    class Stream:
        def __arrow_c_stream__(self, requested_schema=None):
            return table.__arrow_c_stream__(requested_schema)

    return Stream()


def as_a_dictionary():
    return {name: column.to_numpy() for name, column in as_pandas().items()}


def as_a_structured_array():
    return as_pandas().to_records(index=False)


def with_runs_as_categories():
    table = as_pandas()
    table["run"] = table["run"].astype(str).astype("category")
    return table


def with_nullable_numbers():
    return as_pandas().convert_dtypes()


def with_a_column_of_objects():
    table = as_pandas()
    table["remark"] = [object() for _ in range(len(table))]
    return table


TABLES = [
    as_pandas, as_polars, as_polars_lazily, as_pyarrow, as_a_stream, as_a_dictionary,
    as_a_structured_array, with_runs_as_categories, with_nullable_numbers,
    with_a_column_of_objects,
]  # fmt: skip


@pytest.mark.parametrize("made", TABLES, ids=lambda made: made.__name__)
def test_tables_hold_what_their_file_holds(made) -> None:
    spec = leverrier.open(SPEC)
    file, table = spec.data(), spec.data(made())
    assert table.runs == file.runs and table.samples == file.samples
    for name in ("t", *file.observables):
        assert np.array_equal(table.table()[name], file.table()[name], equal_nan=True)


def test_an_array_gives_the_law_of_its_file() -> None:
    spec = leverrier.open(SPEC)
    rows = spec.data().table()
    X = np.column_stack([rows["q"], rows["p"]])
    by_array = spec.fit(X, t=rows["t"], run=rows["run"])
    by_fortran = spec.fit(np.asfortranarray(X), t=rows["t"], run=rows["run"])
    by_list = spec.fit(
        [X[rows["run"] == run] for run in spec.data().runs],
        t=[rows["t"][rows["run"] == run] for run in spec.data().runs],
    )
    wanted = spec.fit().terms[0].coefficient
    for law in (by_array, by_fortran, by_list):
        assert law.terms[0].coefficient == wanted


def test_units_and_names_of_the_spec_hold_for_tables() -> None:
    spec = leverrier.parse(
        'coordinates theta [rad]; momenta omega [rad/s]\ndata "x.csv" { time clock [s] '
        "theta = angle [deg] }\nT = omega^2/2\nV = span{ cos(theta) }"
    )
    data = spec.data({"clock": [0.0, 0.1, 0.2], "angle": [90.0, 45.0, 0.0]})
    assert np.allclose(data.table()["theta"], [np.pi / 2, np.pi / 4, 0.0])
    assert np.allclose(data.table()["t"], [0.0, 0.1, 0.2])
    given = spec.data({"when": [0.0, 0.1], "angle": [90.0, 45.0]}, t="when")
    assert np.allclose(given.table()["t"], [0.0, 0.1])


def test_a_time_step_counts_from_the_start_of_every_run(oscillator) -> None:
    X = np.zeros((6, 2)) + np.arange(6)[:, None]
    data = oscillator.data(X, t=0.5, run=["a", "b", "a", "b", "a", "b"])
    assert data.runs == ["a", "b"]
    assert data.table()["t"].tolist() == [0.0, 0.5, 1.0] * 2


def test_rows_out_of_order_are_put_in_order(oscillator, swing) -> None:
    t, X = swing
    order = np.random.default_rng(0).permutation(len(t))
    data = oscillator.data(X[order], t=t[order])
    assert np.array_equal(data.table()["t"], t)
    assert any("order" in warning for warning in data.warnings)


def test_a_million_rows_enter_in_a_moment() -> None:
    import time

    spec = leverrier.parse("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }")
    t = np.arange(1_000_000) * 0.01
    X = np.column_stack([np.cos(t), -np.sin(t)])
    start = time.perf_counter()
    assert spec.data(X, t=t).samples == 1_000_000
    assert time.perf_counter() - start < 20.0


@pytest.mark.parametrize(
    ("X", "t", "run", "words"),
    [
        (np.zeros((5, 3)), 0.1, None, "shape (5, 3)"),
        (np.zeros((5, 2, 2, 1)), 0.1, None, "shape (5, 2, 2, 1)"),
        (np.zeros((0, 2)), 0.1, None, "nothing was measured"),
        (np.zeros((5, 2)), None, None, "times"),
        (np.zeros((5, 2)), np.zeros(4), None, "t has the shape (4,)"),
        (np.zeros((5, 2)), np.zeros((5, 1)), None, "t has the shape (5, 1)"),
        (np.zeros((5, 2)), [0, 1, np.nan, 3, 4], None, "the time is nan"),
        (np.zeros((5, 2)), -0.1, None, "time step"),
        (np.zeros((5, 2)), float("nan"), None, "time step"),
        (np.zeros((5, 2)), np.full(5, np.datetime64("NaT", "s")), None, "the time is nan"),
        (np.zeros((5, 2, 3)), 0.1, None, "shape (10, 3)"),
        (np.zeros((5, 4, 2)), np.zeros(3), None, "times of 3 runs for 5 runs"),
        (np.zeros((5, 2)), 0.1, [1, 2], "run has the shape (2,)"),
        (np.zeros((5, 2)), np.zeros(5), None, "only one sample"),
        (np.full((5, 2), np.inf), 0.1, None, "infinite"),
        (np.full((5, 2), 1j), 0.1, None, "complex"),
        (np.array([["a", "b"]] * 5), 0.1, None, "'a'"),
        (np.array([[1, object()]] * 5, dtype=object), 0.1, None, "not numbers"),
        ([[1.0, 2.0], [3.0]], 0.1, None, "rows of the same length"),
        ([np.zeros((3, 2)), np.zeros((3, 1))], 0.1, None, "(3, 2), (3, 1)"),
        ([np.zeros((3, 2)), np.zeros((3, 2))], [np.zeros(3)], None, "1 runs for 2 runs"),
        ({"t": [0.0, 1.0]}, None, None, "`q`"),
        ({"t": [0.0, 1.0], "q": [1.0]}, None, None, "1 values in the column `q`"),
        ({"t": [0.0, 1.0], "q": [[1.0], [2.0]], "p": [0, 0]}, None, None, "lists"),
        ({"t": [0.0, 1.0], "q": [object(), object()], "p": [0, 0]}, None, None, "objects"),
        ({"t": [0.0, 1.0], "q": ["1.0", "x"], "p": [0, 0]}, None, None, "`x` is not a number"),
        ({"t": [0.0, 1.0], "q": [0.0, 1.0]}, "clock", None, "no column `clock`"),
        ({}, None, None, "no column"),
        ("nowhere.csv", None, None, "nowhere.csv"),
        (SPEC, 0.1, None, "leave them out"),
        (5, 0.1, None, "shape ()"),
        (None, None, None, "does not name its data"),
    ],
    ids=str,
)  # fmt: skip
def test_what_cannot_be_used_is_told(oscillator, X, t, run, words) -> None:
    with pytest.raises(leverrier.LeverrierError) as told:
        oscillator.fit(X, t=t, run=run)
    assert words in str(told.value)
    assert told.value.hint or isinstance(told.value, leverrier.FileError)


def test_the_place_in_a_table_is_told(oscillator) -> None:
    table = {"t": [0.0, 0.1, np.nan], "q": [1.0, 0.9, 0.8], "p": [0.0, 0.1, 0.2]}
    with pytest.raises(DataError) as told:
        oscillator.data(table)
    assert (told.value.line, told.value.column) == (3, "t")
    assert str(told.value).startswith("row 3, column `t`: ")


def test_a_held_out_share_out_of_range_is_told(pendulum) -> None:
    for share in (1.5, -0.1, float("nan")):
        with pytest.raises(InvalidArgumentError, match="between 0 and 0.9"):
            pendulum.compare(held_out=share)


def test_a_table_that_needs_a_reader_says_so(oscillator, monkeypatch) -> None:
    class Stream:
        def __arrow_c_stream__(self, requested_schema=None):
            raise AssertionError("nobody can read it")

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(InvalidArgumentError, match="pyarrow or polars"):
        oscillator.data(Stream())


def test_measured_inputs_drive_the_motion() -> None:
    spec = leverrier.parse(
        "coordinates x\nmomenta p\ninput F { linear }\nT = p^2/2\nV = span{ x^2 }\n"
        "force x += span{ F }"
    )
    assert spec.inputs == ["F"]
    known = leverrier.parse(
        "coordinates x\nmomenta p\ninput F { linear }\nT = p^2/2\nV = 0.5*x^2\nforce x += 0.3*F"
    ).known_law()
    t = np.arange(400) * 0.05
    u = np.interp(t, t[::10], np.random.default_rng(0).standard_normal(40))
    X = known.predict([0.1, 0.0], t, u=u).states
    law = spec.fit(X, t=t, u=u)
    by_table = spec.fit({"t": t, "x": X[:, 0], "p": X[:, 1], "F": u})
    assert law.coefficient("F") == pytest.approx(0.3, abs=1e-4)
    assert law.coefficient("F") == by_table.coefficient("F")
    for wrong in (None, u[:5], np.column_stack([u, u])):
        with pytest.raises(InvalidArgumentError, match="F"):
            spec.fit(X, t=t, u=wrong)
