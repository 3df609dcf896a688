"""The estimator by the conventions of scikit-learn."""

import pickle

import numpy as np
import pytest

pytest.importorskip("sklearn")

from sklearn.base import clone  # noqa: E402
from sklearn.utils.estimator_checks import parametrize_with_checks  # noqa: E402

import leverrier  # noqa: E402
from leverrier import HamiltonianEstimator  # noqa: E402

ODD = "its data have an odd number of columns, which are no pairs of coordinates and momenta"
FEW = "its rows are fewer than a law needs: they do not outnumber the unknown initial states"

#: Checks of scikit-learn that cannot hold, each with the reason. What they are about is tested on
#: states below.
EXPECTED: dict[str, str] = {
    "check_fit_score_takes_y": ODD,
    "check_dont_overwrite_parameters": ODD,
    "check_positive_only_tag_during_fit": FEW,
    "check_estimators_dtypes": ODD,
    "check_pipeline_consistency": ODD,
    "check_estimators_pickle": ODD,
    "check_f_contiguous_array_estimator": ODD,
    "check_methods_sample_order_invariance": ODD,
    "check_methods_subset_invariance": ODD,
    "check_dict_unchanged": ODD,
    "check_fit_check_is_fitted": ODD,
    "check_fit2d_predict1d": ODD,
}


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


def test_what_the_odd_data_leave_out_holds_on_states(swing) -> None:
    from sklearn.exceptions import NotFittedError
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer

    _, X = swing
    estimator = HamiltonianEstimator(dt=0.1)
    with pytest.raises(NotFittedError):
        estimator.predict(X)
    before = dict(vars(estimator))
    fitted = estimator.fit(X, np.zeros(len(X)))
    assert fitted is estimator
    changed = {name for name in vars(estimator) if name not in before}
    assert changed and all(name.endswith("_") for name in changed - {"n_features_in_"})
    assert all(vars(estimator)[name] == value for name, value in before.items())
    state = dict(vars(estimator))
    predicted = estimator.predict(X)
    assert vars(estimator) == state
    assert estimator.score(X, np.zeros(len(X))) == estimator.score(X)
    # Each row by itself, in any order, in either layout.
    order = np.random.default_rng(0).permutation(len(X))
    assert np.array_equal(estimator.predict(X[order]), predicted[order])
    assert np.array_equal(np.vstack([estimator.predict(row[None]) for row in X]), predicted)
    assert np.array_equal(clone(estimator).fit(np.asfortranarray(X)).coef_, estimator.coef_)
    assert clone(estimator).fit(X.astype(np.float32)).coef_ == pytest.approx(0.5, abs=1e-3)
    pipeline = make_pipeline(FunctionTransformer(), clone(estimator)).fit(X)
    assert np.array_equal(pipeline.predict(X), predicted)
    with pytest.raises(ValueError, match="1D array"):
        estimator.predict(X[0])
    with pytest.raises(ValueError, match="no pairs"):
        clone(estimator).fit(X[:, :1])


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
