"""The first law in one call, from arrays in memory."""

import os
import pickle
import subprocess
import sys
import textwrap
import warnings

import numpy as np
import pytest

import leverrier
from leverrier import DataError, LeverrierWarning

T = np.arange(400) * 0.05


@pytest.fixture(autouse=True)
def warnings_are_errors():
    with warnings.catch_warnings():
        warnings.simplefilter("error", LeverrierWarning)
        yield


def coupled(noise: float = 0.002) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and momenta of two masses, 1 and 3, on springs, one of them stiff."""
    law = leverrier.parse(
        "coordinates x[1..2]; momenta p[1..2]; T = p[1]^2/2 + p[2]^2/6\n"
        "V = x[1]^2/2 + (x[2] - x[1])^2 + 0.3*x[1]^4"
    ).known_law()
    states = law.predict([1.0, -0.5, 0.0, 0.0], T).states
    random = np.random.default_rng(0)
    rates = states[:, 2:] / [1.0, 3.0]
    return tuple(
        one + noise * random.standard_normal(one.shape)
        for one in (states[:, :2], rates, states[:, 2:])
    )


def pendulum() -> np.ndarray:
    law = leverrier.parse(
        "coordinates q; momenta p; T = p^2/2; V = -8*cos(q)\nforce q = -0.1*p"
    ).known_law()
    states = law.predict([1.4, 0.0], T).states
    return states + 0.005 * np.random.default_rng(1).standard_normal(states.shape)


def test_a_law_and_its_errors_come_of_two_arrays() -> None:
    swing = pendulum()
    law = leverrier.learn(T, swing[:, 0])
    assert {term.term for term in law.terms} == {"cos(x)", "-rate(x)"}
    for term, true in (("cos(x)", -8.0), ("drag_x", 0.1)):
        found = next(one for one in law.terms if term in (one.term, one.name))
        assert abs(found.coefficient - true) < 4 * found.standard_error < 0.1
    assert "cos(x)" in str(law) and "force x" in str(law)
    assert law.warnings == [] and law.data.samples == len(T)
    # One goes on from there as from any spec.
    again = leverrier.parse(law.spec.text).fit(law.data)
    assert again == law and law.diagnose().verdict == "nothing_missing"


def test_what_holds_the_positions_does_not_matter() -> None:
    pandas = pytest.importorskip("pandas")
    x, _, _ = coupled()
    wanted = leverrier.learn(T, x)
    frame = pandas.DataFrame({"t": T, "x": x[:, 0], "y": x[:, 1]})
    for law in (
        leverrier.learn(None, frame),
        leverrier.learn("t", frame),
        leverrier.learn(None, frame.set_index("t")),
        leverrier.learn(T, frame.drop(columns="t")),
        leverrier.learn(T, frame.set_index("t")),
        leverrier.learn(None, frame.rename_axis("row")),
        leverrier.learn(None, {"time": T, "x": x[:, 0], "y": x[:, 1]}),
        leverrier.learn(
            None, pandas.DataFrame({"t": T, "x": list(x[:, 0]), "y": x[:, 1]}, dtype=object)
        ),
        leverrier.learn(list(T), x.tolist()),
        leverrier.learn(T, [x]),
        leverrier.learn(T, x[None]),
    ):
        assert law.coefficient("x*y") == pytest.approx(wanted.coefficient("x*y"), rel=1e-9)
        assert law.spec.coordinates == ["x", "y"]


def test_times_out_of_order_are_told() -> None:
    turned = np.random.default_rng(0).permutation(len(T))
    with pytest.warns(LeverrierWarning, match="rows out of order put in the order of time"):
        law = leverrier.learn(T[turned], np.cos(T)[turned])
    assert law.coefficient("x^2") == pytest.approx(0.5, abs=1e-6)


def test_one_coordinate_is_one_axis() -> None:
    swing = pendulum()[:, 0]
    pandas = pytest.importorskip("pandas")
    wanted = leverrier.learn(T, swing).coefficient("cos(x)")
    for x in (swing[:, None], list(swing), pandas.Series(swing)):
        assert leverrier.learn(T, x).coefficient("cos(x)") == wanted
    assert leverrier.learn(None, pandas.Series(swing, index=T)).coefficient("cos(x)") == wanted
    with pytest.raises(leverrier.InvalidArgumentError, match="times of the samples are missing"):
        leverrier.learn(None, pandas.Series(swing))


def test_many_runs() -> None:
    runs = [a * np.cos(2 * T[:n]) for a, n in ((1.0, 400), (0.5, 300), (2.0, 350))]
    times = [T[: len(one)] for one in runs]
    for law in (
        leverrier.learn(times, runs),
        leverrier.learn(0.05, runs),
        leverrier.learn(0.05, [one[:, None] for one in runs]),
        leverrier.learn(
            np.concatenate(times), np.concatenate(runs), run=np.repeat([1, 2, 3], [400, 300, 350])
        ),
        leverrier.learn(0.05, [one.tolist() for one in runs], run=["a", "b", "c"]),
    ):
        assert len(law.data.runs) == 3 and law.coefficient("x^2") == pytest.approx(2.0, abs=1e-6)
    equal = np.array([np.cos(2 * T), 0.3 * np.cos(2 * T)])
    for x in (list(equal), equal[:, :, None]):
        assert leverrier.learn(T, x).data.runs == ["1", "2"]


def test_masses_are_told_where_something_tells_them() -> None:
    x, v, p = coupled()
    for law in (leverrier.learn(T, x), leverrier.learn(T, x, v=v)):
        assert [one.name for one in law.parameters] == ["m_y"]
        assert law.parameters[0].value == pytest.approx(3.0, abs=0.05)
        assert "unit of mass" in law.spec.text
    law = leverrier.learn(T, x, p=p)
    assert [round(one.value, 1) for one in law.parameters] == [1.0, 3.0]
    assert law.spec.observables == ["x", "y", "p_x", "p_y"]
    law = leverrier.learn(T, x, v=v, masses=[2.0, 6.0])
    assert law.parameters == [] and law.coefficient("x*y") == pytest.approx(-4.0, abs=0.03)


def test_a_mass_that_nothing_tells_is_the_unit() -> None:
    x = np.column_stack([np.cos(T), 0.5 * np.cos(1.7 * T)])
    law = leverrier.learn(T, x)
    assert law.parameters == [] and law.coefficient("y^2") == pytest.approx(1.7**2 / 2, abs=1e-6)
    assert "that of y taken for one" in law.spec.text


def test_names_degree_and_harmonics() -> None:
    spec = leverrier.learn(T, np.cos(T), names=["angle"], degree=2, harmonics=2, drag=False).spec
    assert spec.coordinates == ["angle"]
    assert spec.terms == [
        "angle",
        "angle^2",
        "sin(angle)",
        "cos(angle)",
        "sin(2*angle)",
        "cos(2*angle)",
    ]
    # The sine of what moves little is a polynomial.
    assert leverrier.learn(T, 0.1 * np.cos(T)).spec.terms == ["x", "x^2", "x^3", "x^4", "-rate(x)"]
    assert leverrier.learn(T, np.cos(T), names="t").spec.coordinates == ["t"]
    many = leverrier.learn(T, np.cos(T[:, None] * [1.0, 1.3, 1.6, 1.9]), harmonics=0)
    assert many.spec.coordinates == ["x1", "x2", "x3", "x4"]


def test_measured_inputs_drive_it() -> None:
    u = np.sin(3 * T) + np.cos(1.1 * T)
    driven = leverrier.parse(
        "coordinates x; momenta p; input u { linear }; T = p^2/2; V = x^2; force x = 0.7*u"
    ).known_law()
    x = driven.predict([1.0, 0.0], T, u=u).states[:, 0]
    for law in (leverrier.learn(T, x, u=u), leverrier.learn(T, [x, x], u=[u, u])):
        assert law.coefficient("u") == pytest.approx(0.7, abs=1e-4)
    two = leverrier.learn(T, x, u=np.column_stack([u, T % 1.0]))
    assert two.spec.inputs == ["u1", "u2"] and two.coefficient("u2") == 0.0


def test_a_law_that_misses_something_says_so() -> None:
    swing = pendulum()
    with pytest.warns(LeverrierWarning, match="over whole runs the law errs by .* times the noise"):
        law = leverrier.learn(T, swing[:, 0], v=swing[:, 1], drag=False)
    assert "law.diagnose()" in law.warnings[0] and law.warnings[0] in repr(law)
    assert pickle.loads(pickle.dumps(law)).warnings == law.warnings
    assert law.diagnose().verdict == "missing"


def test_a_run_that_many_others_hide_is_told() -> None:
    random = np.random.default_rng(0)
    sizes = np.linspace(0.5, 1.6, 12)
    runs = [a * np.cos(2 * T) + 0.01 * random.standard_normal(len(T)) for a in sizes]
    assert leverrier.learn(T, runs).warnings == []
    runs[3] = sizes[3] * np.cos(2.015 * T) + 0.01 * random.standard_normal(len(T))
    with pytest.warns(
        LeverrierWarning, match="of 12 runs the law fails 1: it errs over run `4` by"
    ):
        law = leverrier.learn(T, runs, degree=2, harmonics=0)
    assert law.data.only(4).runs == ["4"]


def test_noise_that_is_known_is_held_against_what_is_found() -> None:
    swing = pendulum()
    assert leverrier.learn(T, swing[:, 0], v=swing[:, 1], noise=[0.005, 0.005]).warnings == []
    with pytest.warns(LeverrierWarning, match="the noise of x is .* by this law, and 0.001 as you"):
        leverrier.learn(T, swing[:, 0], noise=0.001)


def test_what_explains_nothing_says_so() -> None:
    with pytest.warns(LeverrierWarning, match="it explains nothing"):
        leverrier.learn(T, np.random.default_rng(0).standard_normal(len(T)))
    with pytest.warns(LeverrierWarning, match="3 measured numbers stand against 3 unknown"):
        leverrier.learn(0.1, [1.0, 0.9, 0.7])


def test_coefficients_that_are_not_known_are_told() -> None:
    t = np.arange(15) * 0.04
    x = np.cos(5 * t) + 0.01 * np.random.default_rng(2).standard_normal(15)
    with pytest.warns(LeverrierWarning) as told:
        leverrier.learn(t, x)
    said = " ".join(str(one.message) for one in told)
    assert "15 measured numbers stand against 9" in said and "`cos(x)`" in said
    assert "is not known: its error is as large as itself" in said


def test_where_no_law_follows_it_says_so() -> None:
    t = np.arange(200) * 2.8
    x = np.cos(t) + 0.01 * np.random.default_rng(0).standard_normal(200)
    with pytest.raises(leverrier.NoResultError, match="no law of this kind follows") as told:
        leverrier.learn(t, x)
    assert "leverrier.parse" in told.value.hint and told.value.kind == "NoLaw"


def test_lengths_are_no_angles() -> None:
    # In millimetres a sine would turn between two samples.
    assert leverrier.learn(T, 1000 * np.cos(T)).spec.terms == ["x", "x^2", "x^3", "x^4", "-rate(x)"]


X = np.cos(T)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"t": T[:5]}, "t has the shape (5,)"),
        ({"t": None}, "times of the samples are missing"),
        ({"t": "t"}, "no table"),
        ({"t": 0.0}, "time step"),
        ({"x": "swings.csv"}, "pandas.read_csv"),
        ({"x": None}, "shape ()"),
        ({"x": []}, "shape (0, 1)"),
        ({"x": np.zeros((2, 2, 2, 2))}, "shape (2, 2, 2, 2)"),
        ({"x": [X, X[:5]]}, "runs of 400, 5 samples"),
        ({"x": [X, X[:, None] * [1, 1]]}, "(400, 1), (400, 2)"),
        ({"x": 1j * X}, "complex"),
        ({"t": None, "x": {"x": X}}, "no column of the times"),
        ({"t": "clock", "x": {"t": T, "x": X}}, "no column `clock`"),
        ({"x": {"t": T}, "t": "t"}, "no column of positions"),
        ({"x": {"t": T, "x": ["a"] * 400}, "t": "t"}, "column `x`: the column holds text"),
        ({"v": X, "p": X}, "both given"),
        ({"v": X[:5]}, "give v in the shape of x"),
        ({"p": X[:, None] * [1, 1]}, "give p in the shape of x"),
        ({"u": X[:5]}, "shape (5, 1)"),
        ({"u": np.zeros((400, 1, 1, 1))}, "give a column for each input"),
        ({"run": ["a"]}, "run has the shape (1,)"),
        ({"names": ["x", "y"]}, "not those of 1 coordinate;"),
        ({"names": "an angle"}, "`an angle` cannot name"),
        ({"names": "T"}, "`T` cannot be a name"),
        ({"masses": -1}, "positive mass"),
        ({"masses": [1, 2]}, "positive mass"),
        ({"noise": 0}, "standard deviation"),
        ({"noise": [1, 2]}, "standard deviation"),
        ({"degree": 0}, "degree is 0"),
        ({"degree": 2.5}, "degree is 2.5"),
        ({"harmonics": -1}, "harmonics is -1"),
        ({"x": np.zeros(400)}, "measurements"),
        ({"x": np.full(400, np.nan)}, "measure"),
        ({"seed": -1}, "seed"),
        ({"threads": 0}, "threads"),
    ],
    ids=lambda one: one if isinstance(one, str) else ",".join(one),
)  # fmt: skip
def test_what_cannot_be_learned_from_is_told(arguments, said) -> None:
    given = {"t": T, "x": X} | arguments
    with pytest.raises(leverrier.LeverrierError) as told:
        leverrier.learn(given.pop("t"), given.pop("x"), **given)
    assert said in str(told.value)
    assert told.value.hint and "\n" not in str(told.value)


def test_a_table_names_its_runs() -> None:
    table = {"t": np.r_[T, T], "x": np.r_[X, 0.5 * X], "trial": ["a"] * 400 + ["b"] * 400}
    assert leverrier.learn("t", table, run="trial").data.runs == ["a", "b"]
    named = {"t": table["t"], "x": table["x"], "Run": np.repeat([1, 2], 400)}
    law = leverrier.learn(None, named)
    assert law.data.runs == ["1", "2"] and law.spec.coordinates == ["x"]
    with pytest.raises(DataError, match="time jumps back"):
        leverrier.learn(None, {"t": table["t"], "x": table["x"], "trial": named["Run"]})
    with pytest.raises(DataError, match="column `trial`: the column holds text; .* run= names"):
        leverrier.learn("t", table)


def test_an_interrupt_of_the_second_search_keeps_what_the_first_found(monkeypatch) -> None:
    fit, called = leverrier.Spec.fit, []

    def once(self, *arguments, **options):
        called.append(self)
        if len(called) > 1:
            raise KeyboardInterrupt
        return fit(self, *arguments, **options)

    monkeypatch.setattr(leverrier.Spec, "fit", once)
    x = np.column_stack([np.cos(T), 0.5 * np.cos(1.7 * T)])
    with pytest.warns(LeverrierWarning, match="the best so far, with masses that nothing tells"):
        law = leverrier.learn(T, x)
    assert [term.term for term in law.terms] == ["x^2", "y^2"] and len(called) == 2


@pytest.mark.skipif(os.name == "nt", reason="signals of Windows are others")
def test_ctrl_c_keeps_the_best_so_far() -> None:
    program = """
        import os, signal, warnings
        import numpy as np
        import leverrier

        random = np.random.default_rng(0)
        t = np.arange(40000) * 0.05
        w = np.sqrt(2.0)
        x = np.column_stack([np.cos(t), np.cos(w*t)]) + 0.01 * random.standard_normal((40000, 2))
        sent = []
        def progress(stage, fraction):
            if "segments" in stage and not sent:
                sent.append(stage)
                os.kill(os.getpid(), signal.SIGINT)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            law = leverrier.learn(t, x, degree=8, progress=progress)
        print(law.stop.reason, any("the best so far" in str(one.message) for one in told))
    """
    found = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert found.stdout.split() == ["interrupted", "True"], found
