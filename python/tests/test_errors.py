"""Exceptions: a small tree, with message, hint and place."""

import pickle

import numpy as np
import pytest

import leverrier


def test_a_spec_that_does_not_parse_has_its_place() -> None:
    text = "coordinates q; momenta p\nT = p^2/2\nV = span{ q^2, foo, bar }"
    with pytest.raises(leverrier.SpecError) as told:
        leverrier.parse(text)
    error = told.value
    assert isinstance(error, ValueError) and isinstance(error, leverrier.LeverrierError)
    assert len(error.diagnostics) >= 2 and error.kind == "Spec"
    assert (error.line, text.encode()[slice(*error.diagnostics[-1].span)]) != (None, b"")
    assert any(text[slice(*one.span)] == "foo" for one in error.diagnostics)
    assert "^^^" in str(error) and "line 3" in str(error)


def test_every_kind_of_error_has_its_class(tmp_path, pendulum) -> None:
    cases = [
        (lambda: leverrier.open("nowhere.ham"), leverrier.FileError, OSError),
        (lambda: leverrier.parse(""), leverrier.SpecError, ValueError),
        (lambda: leverrier.parse(3), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.add("no_such_effect"), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.add(None), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.predict([1.0], [0.0, 1.0]), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.predict([1.0, "x"], [0.0]), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.rhs(0.0, [1.0]), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.coefficient("q^9"), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.spec.fit(seed=-1), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.spec.fit(threads=0), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.spec.fit(window=1), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.spec.fit(loss="none"), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.spec.fit(memory="much"), leverrier.InvalidArgumentError, ValueError),
        (lambda: pendulum.spec.law(tmp_path / "none.json"), leverrier.ModelError, ValueError),
    ]
    for work, own, builtin in cases:
        with pytest.raises(own) as told:
            work()
        assert isinstance(told.value, builtin) and told.value.message


WRONG = {
    "much memory": lambda spec, law, X: spec.fit(X, t=0.1, memory=2**70),
    "no memory": lambda spec, law, X: spec.fit(X, t=0.1, memory=-5),
    "little memory": lambda spec, law, X: spec.fit(X, t=0.1, memory=100),
    "a long window": lambda spec, law, X: spec.fit(X, t=0.1, window=2**70),
    "a window of text": lambda spec, law, X: spec.fit(X, t=0.1, window="a"),
    "a step of text": lambda spec, law, X: spec.fit(X, t=0.1, step="a"),
    "no method": lambda spec, law, X: spec.fit(X, t=0.1, method="a"),
    "a number for a method": lambda spec, law, X: spec.fit(X, t=0.1, method=3),
    "progress": lambda spec, law, X: law.diagnose(progress=5),
    "data of another spec": lambda spec, law, X: law.compare(spec.with_effect("bias(q)"), t=0.1),
    "no times": lambda spec, law, X: law.predict([1, 0], []),
    "times that are none": lambda spec, law, X: law.predict([1, 0], [0, float("nan")]),
    "times that turn": lambda spec, law, X: law.predict([1, 0], [1, 0, 1]),
    "a time twice": lambda spec, law, X: law.predict([1, 0], [1, 0, 0]),
    "half a start in the past": lambda spec, law, X: law.predict([1], [1, 0]),
    "a start that is none in the past": lambda spec, law, X: law.predict([1, np.nan], [1, 0]),
    "starts of three axes": lambda spec, law, X: law.predict(np.zeros((2, 2, 2)), [0, 1]),
    "starts that are short": lambda spec, law, X: law.predict(np.zeros((2, 1)), [0, 1]),
    "inputs that are none": lambda spec, law, X: law.rhs(0.0, [1, 0], u=1.0),
    "no start": lambda spec, law, X: law.predict(None, [0, 1]),
    "half a start": lambda spec, law, X: law.predict({"q": 1}, [0, 1]),
    "a state of objects": lambda spec, law, X: law.rhs(0.0, [object(), 1]),
    "a time of text": lambda spec, law, X: law.rhs("a", [0.0, 1.0]),
    "too many axes": lambda spec, law, X: law.rhs(0.0, X.reshape(2, -1, 2)),
    "an effect on nothing": lambda spec, law, X: law.add(""),
    "an injected statement": lambda spec, law, X: law.add("viscous_drag(q); T = 3"),
    "nothing to remove": lambda spec, law, X: law.remove("q^9"),
    "a zero in a text": lambda spec, law, X: leverrier.parse("coordinates \0"),
    "half a character": lambda spec, law, X: leverrier.parse("coordinates \ud800"),
    "half a character in a name": lambda spec, law, X: leverrier.open("a\ud800"),
    "a zero in a name": lambda spec, law, X: leverrier.open("a\0b"),
    "a folder": lambda spec, law, X: leverrier.open("examples"),
    "nowhere to save": lambda spec, law, X: law.save("nowhere/at/all.json"),
    "a column that is a number": lambda spec, law, X: spec.fit({"t": 0.1, "q": 1.0}),
    "a column that is a dictionary": lambda spec, law, X: spec.fit({"t": {"a": 1}, "q": [1, 2]}),
    "a set": lambda spec, law, X: spec.fit({1, 2, 3}, t=0.1),
    "negative noise": lambda spec, law, X: law.simulate([[1, 0]], [0, 1], noise=-1),
    "starts that are none": lambda spec, law, X: law.simulate(3, [0, 1]),
    "a share of text": lambda spec, law, X: law.compare(held_out="a"),
    "a broken seed": lambda spec, law, X: law.compare(seed=1.5),
    "nothing measured": lambda spec, law, X: spec.fit(X * float("nan"), t=0.1),
    "runs that are objects": lambda spec, law, X: spec.fit(X, t=0.1, run=[object()] * len(X)),
    "runs without names": lambda spec, law, X: spec.fit(X, t=0.1, run=[None] * len(X)),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_arguments_are_told(what, oscillator, pendulum, swing) -> None:
    with pytest.raises(leverrier.LeverrierError) as told:
        WRONG[what](oscillator, pendulum, swing[1])
    assert len(str(told.value)) > 10


def test_too_few_measurements_are_told(oscillator) -> None:
    with pytest.raises(leverrier.DataError) as told:
        oscillator.fit([[1.0, 0.0], [0.9, -0.1]], t=[0.0, 0.1])
    assert told.value.kind in ("InsufficientData", "NotIdentifiable")


def test_errors_can_be_pickled() -> None:
    with pytest.raises(leverrier.SpecError) as told:
        leverrier.parse("V = foo")
    again = pickle.loads(pickle.dumps(told.value))
    assert str(again) == str(told.value) and again.span == told.value.span
