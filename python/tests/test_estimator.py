"""The estimator by the conventions of scikit-learn."""

import pickle

import numpy as np
import pytest

pytest.importorskip("sklearn")

from sklearn.base import clone  # noqa: E402
from sklearn.utils.estimator_checks import parametrize_with_checks  # noqa: E402

import leverrier  # noqa: E402
from leverrier import HamiltonianEstimator  # noqa: E402

#: Checks of scikit-learn that cannot hold, each with the reason.
EXPECTED: dict[str, str] = {}


@parametrize_with_checks(
    [HamiltonianEstimator(starts=0)], expected_failed_checks=lambda estimator: EXPECTED
)
def test_conventions(estimator, check) -> None:
    check(estimator)


def test_it_learns_and_predicts(swing) -> None:
    t, X = swing
    estimator = HamiltonianEstimator(dt=0.1).fit(X)
    assert estimator.terms_ == ["q[1]^2"] and estimator.coef_[0] == pytest.approx(0.5, abs=1e-9)
    assert np.allclose(estimator.predict(X[:-1]), X[1:], atol=1e-8)
    assert estimator.score(X) > 1 - 1e-9
    by_times = HamiltonianEstimator(dt=0.1).fit(X, t=t)
    assert by_times.coef_ == estimator.coef_


def test_specs_are_given_as_text_file_or_object() -> None:
    path = "examples/damped-pendulum/fit.ham"
    spec = leverrier.open(path)
    rows = spec.data().table()
    X = np.column_stack([rows["q"], rows["p"]])
    found = [
        HamiltonianEstimator(given).fit(X, t=rows["t"], run=rows["run"]).coef_[0]
        for given in (spec, spec.text, path)
    ]
    assert found[0] == found[1] == found[2] and found[0] == pytest.approx(-1.0, abs=0.01)


def test_clones_and_pickles(swing) -> None:
    t, X = swing
    estimator = HamiltonianEstimator("coordinates q; momenta p\nT = p^2/2\nV = span{ q^2 }", dt=0.1)
    fresh = clone(estimator.fit(X))
    assert fresh.get_params() == estimator.get_params() and not hasattr(fresh, "law_")
    again = pickle.loads(pickle.dumps(estimator))
    assert np.array_equal(again.predict(X), estimator.predict(X))
    assert again.law_.model.to_dict() == estimator.law_.model.to_dict()
