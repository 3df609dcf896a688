"""The estimator by the conventions of scikit-learn."""

import pickle

import numpy as np
import pytest

pytest.importorskip("sklearn")

from sklearn.base import clone  # noqa: E402
from sklearn.utils.estimator_checks import parametrize_with_checks  # noqa: E402

import leverrier  # noqa: E402
from leverrier import HamiltonianEstimator  # noqa: E402

#: Checks of scikit-learn that cannot hold, each with the reason. What they are about is tested on
#: states below.
NO_MOTION = (
    "its rows are no motion of any law that is offered: predictions from one to the next overflow, "
    "and what is left does not outnumber the unknown initial states"
)
EXPECTED: dict[str, str] = {
    "check_fit_check_is_fitted": NO_MOTION,  # noise about 100, with a polynomial of degree 4
    "check_positive_only_tag_during_fit": NO_MOTION,  # the irises
}


def test_few_checks_are_expected_to_fail() -> None:
    assert len(EXPECTED) <= 3


@pytest.mark.filterwarnings("ignore::leverrier.LeverrierWarning")
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


def driven() -> tuple[np.ndarray, np.ndarray]:
    """States of a spring, and the force that it was held under from one to the next."""
    law = leverrier.parse(
        "coordinates q; momenta p; input u { hold }; T = p^2/2; V = q^2/2; force q = 0.5*u"
    ).known_law()
    t = np.arange(200) * 0.1
    u = np.random.default_rng(0).standard_normal(200)
    return law.predict([1.0, 0.0], t, u=u).states, u


def test_measured_inputs_go_beside_the_states() -> None:
    X, u = driven()
    estimator = HamiltonianEstimator(dt=0.1).fit(X, u=u)
    assert dict(zip(estimator.terms_, estimator.coef_)) == pytest.approx(
        {"q[1]^2": 0.5, "u1": 0.5}, abs=1e-6
    )
    assert np.allclose(estimator.predict(X[:-1], u=u[:-1]), X[1:], atol=1e-6)
    assert estimator.score(X, u=u) > 1 - 1e-8
    gaps = np.where(u > 0, u, np.nan)
    assert np.array_equal(np.isnan(estimator.predict(X, u=gaps)[:, 0]), np.isnan(gaps))
    spec = "coordinates q; momenta p; input u { hold }; T = p^2/2; V = span{ q^2 }; force q = span{ u }"
    own = HamiltonianEstimator(spec, dt=0.1).fit(X, u=u)
    assert own.coef_ == pytest.approx([0.5, 0.5], abs=1e-6)
    for wrong, said in (
        (lambda: estimator.predict(X), "driven by u1: give u="),
        (lambda: estimator.predict(X, u=u[:5]), "u has 5 rows"),
        (lambda: estimator.score(X), "fit was given u=, and score was not"),
        (lambda: HamiltonianEstimator(spec, dt=0.1).fit(X), "driven by u: give u="),
        (lambda: HamiltonianEstimator(dt=0.1).fit(X, u=u[:5]), "u has 5 rows"),
    ):
        with pytest.raises(ValueError, match=said):
            wrong()


def test_a_last_column_without_a_partner_is_an_input() -> None:
    X, u = driven()
    both = np.column_stack([X, u])
    estimator = HamiltonianEstimator(dt=0.1)
    with pytest.warns(leverrier.LeverrierWarning, match="the last is taken for a measured input"):
        estimator.fit(both)
    assert estimator.terms_ == ["q[1]^2", "u1"] and estimator.n_features_in_ == 3
    assert np.allclose(estimator.predict(both[:-1]), X[1:], atol=1e-6)
    assert estimator.score(both) > 1 - 1e-8
    # Rows without the input are left out, and the others keep their times.
    both[50, 2] = np.nan
    both[51:53] = np.nan
    with pytest.warns(leverrier.LeverrierWarning):
        again = clone(estimator).fit(both)
    assert again.terms_ == ["q[1]^2", "u1"] and again.coef_[0] == pytest.approx(0.5, abs=0.05)


def test_what_the_checks_leave_out_holds_on_states(swing) -> None:
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
