"""Runs as lists and arrays, dates as times, columns that are found by name; pickled data."""

import pickle
from datetime import datetime, timedelta, timezone

import numpy as np
import pytest

import leverrier
from leverrier import DataError, InvalidArgumentError

T = np.arange(50) * 0.1
STATES = np.column_stack([np.cos(T), -np.sin(T)])
#: Another run: of two that are alike the library takes one.
SMALL = 0.5 * STATES
SPEC = "coordinates q; momenta p; T = p^2/2; V = span{ q^2 }"


@pytest.fixture
def spec() -> leverrier.Spec:
    return leverrier.parse(SPEC)


def in_units(unit: str) -> leverrier.Spec:
    return leverrier.parse(
        f"coordinates q [m]; momenta p [kg*m/{unit}]; time t [{unit}]; T = p^2/(2*1 [kg])\n"
        "V = span{ q^2 }  # time t [h] is no more than a comment"
    )


def dates() -> dict:
    pandas = pytest.importorskip("pandas")
    start = datetime(2024, 1, 1, 12)
    steps = (T * 1e9).round().astype("m8[ns]")
    stamps = pandas.Timestamp(start) + pandas.to_timedelta(steps)
    zone = timezone(timedelta(hours=2))
    return {
        "datetime64": np.datetime64(start) + steps,
        "timedelta64": steps,
        "timestamps": list(stamps),
        "index": stamps,
        "series": pandas.Series(stamps),
        "zoned index": stamps.tz_localize("Europe/Berlin"),
        "zoned series": pandas.Series(stamps.tz_localize("Europe/Berlin")),
        "datetimes": [start + timedelta(seconds=float(one)) for one in T],
        "zoned datetimes": [
            start.replace(tzinfo=zone) + timedelta(seconds=float(one)) for one in T
        ],
        "timedeltas": [timedelta(seconds=float(one)) for one in T],
        "pandas' durations": pandas.to_timedelta(steps),
    }


@pytest.mark.parametrize("kind", list(dates()))
def test_dates_are_times(spec, kind) -> None:
    pandas = pytest.importorskip("pandas")
    t = dates()[kind]
    for data in (
        spec.data(STATES, t=t),
        spec.data({"t": t, "q": STATES[:, 0], "p": STATES[:, 1]}),
        spec.data({"when": t, "q": STATES[:, 0], "p": STATES[:, 1]}, t="when"),
        spec.data({"q": STATES[:, 0], "p": STATES[:, 1]}, t=t),
        spec.data(pandas.DataFrame(STATES, columns=["q", "p"], index=pandas.Index(t))),
        spec.data([STATES, SMALL], t=[t, t]).only(1),
    ):
        assert np.allclose(data.table()["t"], T, atol=2e-9)
    law = leverrier.learn(t, STATES[:, 0])
    assert law.coefficient("x^2") == pytest.approx(0.5, abs=1e-6)


def test_polars_and_pyarrow_have_dates(spec) -> None:
    polars = pytest.importorskip("polars")
    table = {"t": dates()["datetime64"], "q": STATES[:, 0], "p": STATES[:, 1]}
    for made in (polars.DataFrame(table), polars.DataFrame(table).to_arrow()):
        assert np.allclose(spec.data(made).table()["t"], T, atol=2e-9)


def test_dates_are_turned_into_the_units_of_the_spec() -> None:
    t = dates()["datetime64"]
    assert np.allclose(in_units("ms").data(STATES, t=t).table()["t"], 1000 * T)
    spec = leverrier.parse(
        "coordinates q [m]; momenta p [kg*m/s]; time t [s]; T = p^2/(2*1 [kg]); V = span{ q^2 }\n"
        'data "x.csv" { time clock [ms] }'
    )
    table = {"clock": t, "q": STATES[:, 0], "p": STATES[:, 1]}
    assert np.allclose(spec.data(table).table()["t"], T)
    assert np.allclose(spec.data(STATES, t=t).table()["t"], T)
    with pytest.raises(DataError, match=r"unit of time is \[week\]; give them as numbers") as told:
        leverrier.times.numbers_of(t, "week")
    assert told.value.column == "t"


def test_dates_of_two_kinds_are_told(spec) -> None:
    mixed = [datetime(2024, 1, 1), *[datetime(2024, 1, 1, tzinfo=timezone.utc)] * 49]
    with pytest.raises(DataError, match="time zone, or none"):
        spec.data(STATES, t=mixed)
    with pytest.raises(DataError, match="the time is nan"):
        spec.data(STATES, t=[*dates()["datetime64"][:-1], np.datetime64("NaT")])


def test_a_step_may_be_a_duration(spec) -> None:
    for step in (np.timedelta64(100, "ms"), timedelta(seconds=0.1)):
        assert np.allclose(spec.data(STATES, t=step).table()["t"], T)


def test_an_index_has_the_times(spec) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(STATES, columns=["q", "p"])
    clocked = leverrier.parse(SPEC + '; data "x.csv" { time clock }')
    for data in (
        spec.data(frame.set_index(pandas.Index(T))),
        spec.data(frame.set_index(pandas.Index(T, name="t"))),
        spec.data(frame.set_index(pandas.Index(T, name="Time"))),
        clocked.data(frame.set_index(pandas.Index(T, name="clock"))),
        clocked.data(frame.set_index(pandas.Index(T))),
        spec.data(frame.set_index(pandas.Index(T, name="elapsed")), t="elapsed"),
    ):
        assert np.array_equal(data.table()["t"], T)
    both = pandas.MultiIndex.from_arrays([["a"] * 25 + ["b"] * 25, T], names=["run", "t"])
    assert spec.data(frame.set_index(both)).runs == ["a", "b"]
    # Numbers of rows are no times.
    with pytest.raises(DataError, match="no column holds the time"):
        spec.data(frame)
    with pytest.raises(DataError, match="no column holds the time") as told:
        spec.data(frame.set_index(pandas.Index(T, name="elapsed")))
    assert "or give t= and run=" in told.value.hint


def test_a_column_names_the_runs(spec) -> None:
    both = np.concatenate([STATES, SMALL])
    table = {"t": np.r_[T, T], "q": both[:, 0], "p": both[:, 1]}
    names = ["a"] * 50 + ["b"] * 50
    assert spec.data(table | {"run": names}).runs == ["a", "b"]
    assert spec.data(table | {"Run": names}).runs == ["a", "b"]
    assert spec.data(table | {"trial": names}, run="trial").runs == ["a", "b"]
    named = leverrier.parse(SPEC + '; data "x.csv" { time t run trial }')
    assert named.data(table | {"trial": names, "run": list(range(100))}).runs == ["a", "b"]
    for told in (lambda: spec.data(table), lambda: spec.data(table | {"trial": names})):
        with pytest.raises(DataError, match="time jumps back") as error:
            told()
        assert "give t= and run=" in error.value.hint
    with pytest.raises(DataError, match="no column `trial` for the run") as error:
        named.data(table)
    assert "give t= and run=" in error.value.hint


def test_runs_are_lists_and_arrays(spec) -> None:
    wanted = spec.data(np.concatenate([STATES, SMALL]), t=np.r_[T, T], run=["1"] * 50 + ["2"] * 50)
    for X, t in (
        ([STATES, SMALL], [T, T]),
        ([STATES, SMALL], T),
        ([STATES, SMALL], 0.1),
        ((STATES, SMALL), T),
        (np.stack([STATES, SMALL]), T),
        (np.stack([STATES, SMALL]), [T, T]),
        (np.stack([STATES, SMALL]), np.stack([T, T])),
    ):
        data = spec.data(X, t=t)
        assert data.runs == ["1", "2"]
        for name in ("t", "q", "p"):
            assert np.allclose(data.table()[name], wanted.table()[name])
    q = STATES[:, 0]
    for X, t in (([q, q[:30]], [T, T[:30]]), ([q, q[:30]], 0.1)):
        data = spec.data(X, t=t)
        assert data.samples == 80 and np.isnan(data.table()["p"]).all()
    # States, one a row, are no runs.
    assert spec.data(list(STATES), t=T).runs == ["1"]
    assert spec.data([STATES, SMALL], t=T, run=["a", "b"]).runs == ["a", "b"]


@pytest.mark.parametrize(
    ("X", "t", "said"),
    [
        ([STATES, SMALL[:30]], T, "times of 50 runs for 2 runs"),
        ([STATES, SMALL[:30]], [T, T], r"run 2 has 30 samples and times of shape \(50,\)"),
        ([STATES, SMALL], [T], "times of 1 runs for 2 runs"),
        ([STATES, STATES[:, :1]], 0.1, r"\(50, 2\), \(50, 1\)"),
        ([STATES, SMALL], [T[:, None], T[:, None]], r"times of shape \(50, 1\)"),
    ],
)
def test_runs_that_do_not_fit_are_told(spec, X, t, said) -> None:
    with pytest.raises(InvalidArgumentError, match=said) as told:
        spec.data(X, t=t)
    assert told.value.hint


def driven() -> leverrier.Spec:
    return leverrier.parse(
        "coordinates q; momenta p; input u { linear }; T = p^2/2; V = span{ q^2 }; force q += span{ u }"
    )


def test_inputs_of_runs_do_not_slip() -> None:
    u = np.sin(3 * T)
    spec = driven()
    for given in ([u, u], np.stack([u, u]), [u[:, None], u[:, None]]):
        assert spec.data([STATES, SMALL], t=T, u=given).runs == ["1", "2"]
    with pytest.raises(InvalidArgumentError, match="run 1 has 50 samples and inputs of shape"):
        spec.data([STATES, SMALL], t=T, u=[u[:40], np.r_[u, u[:10]]])
    with pytest.raises(InvalidArgumentError, match="inputs of 1 runs for 2"):
        spec.data([STATES, SMALL], t=T, u=[u])


def test_data_are_pickled(spec, pendulum) -> None:
    random = np.random.default_rng(0)
    noisy = STATES + 0.01 * random.standard_normal(STATES.shape)
    noisy[3, 1] = np.nan
    order = random.permutation(50)
    table = {"t": T, "q": noisy[:, 0], "p": noisy[:, 1], "u": np.sin(T), "rig": ["a"] * 50}
    grouped = leverrier.parse(SPEC + "; param k per rig = 1; force q = -k*q^3")
    for of, data in (
        (spec, spec.data(noisy[order], t=T[order])),
        (spec, spec.data([noisy, 0.5 * noisy], t=T, run=["a", "b"])),
        (spec, spec.data(table)),
        (pendulum.spec, pendulum.data),
        (driven(), driven().data(noisy, t=T, u=np.sin(T))),
        (driven(), driven().data(table)),
        (driven(), driven().data([noisy, 0.5 * noisy], t=T, u=[T, T]).split()[0]),
        (grouped, grouped.data(table)),
    ):
        again = pickle.loads(pickle.dumps(data))
        assert repr(again) == repr(data) and again.warnings == data.warnings
        for name in ("run", "t", *data.observables):
            assert np.array_equal(again.table()[name], data.table()[name], equal_nan=name != "run")
        assert of.fit(again).terms == of.fit(data).terms
        assert pickle.loads(pickle.dumps(again)).samples == data.samples


def test_what_was_given_may_change_afterwards() -> None:
    X, u = STATES.copy(), np.sin(T)
    data = driven().data(X, t=T, u=u)
    wanted = driven().fit(data)
    X[:], u[:] = 0.0, 0.0
    assert driven().fit(pickle.loads(pickle.dumps(data))) == wanted


def test_a_file_with_inputs_is_pickled_by_its_name(tmp_path) -> None:
    rows = [f"{t},{q},{p},{u}" for t, (q, p), u in zip(T, STATES, np.sin(T))]
    (tmp_path / "x.csv").write_text("\n".join(["t,q,p,u", *rows]), encoding="utf-8")
    data = driven().data(tmp_path / "x.csv")
    with pytest.raises(InvalidArgumentError, match="pickle the name of the file"):
        pickle.dumps(data)


def test_runs_are_taken_alone(pendulum) -> None:
    data = pendulum.data.only("5", 2)
    assert data.runs == ["2", "5"] and data.only("5").samples < data.samples
    for wrong, said in ((("9",), "no run 9"), ((), "no run is named")):
        with pytest.raises(InvalidArgumentError, match=said):
            pendulum.data.only(*wrong)
    with pytest.raises(InvalidArgumentError, match="not taken apart"):
        driven().data(STATES, t=T, u=T).only("1")
