"""Exceptions: a small tree, with message, hint and place."""

import pickle

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


def test_too_few_measurements_are_told(oscillator) -> None:
    with pytest.raises(leverrier.DataError) as told:
        oscillator.fit([[1.0, 0.0], [0.9, -0.1]], t=[0.0, 0.1])
    assert told.value.kind in ("InsufficientData", "NotIdentifiable")


def test_errors_can_be_pickled() -> None:
    with pytest.raises(leverrier.SpecError) as told:
        leverrier.parse("V = foo")
    again = pickle.loads(pickle.dumps(told.value))
    assert str(again) == str(told.value) and again.span == told.value.span
