"""What could be wrong without a word: it is right, or an error that says what to give."""

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import leverrier

T = np.arange(100) * 0.1


def springs() -> leverrier.Law:
    """A law of two runs, each of a stiffness of its own: 1 and 4."""
    X = [np.column_stack([np.cos(w * T), -w * np.sin(w * T)]) for w in (1.0, 2.0)]
    spec = leverrier.parse(
        "coordinates q; momenta p; param k per run in 0.5..9; T = p^2/2; V = k*q^2/2"
    )
    return spec.fit(X, t=0.1, run=["soft", "stiff"])


def driven() -> leverrier.Law:
    return leverrier.parse(
        "coordinates q; momenta p; input u { linear }; T = p^2/2; V = q^2/2 - u*q"
    ).known_law()


def test_a_law_of_many_runs_takes_no_mean() -> None:
    law = springs()
    for call in (
        lambda: law.rhs(0.0, [1, 0]),
        lambda: law.energy(0.0, [1, 0]),
        lambda: law.vector_field,
        lambda: law.predict([1, 0], [0.0, 1.0]),
        lambda: law.simulate([[1, 0]], [0.0, 1.0]),
    ):
        with pytest.raises(leverrier.InvalidArgumentError, match="`k` has another value") as told:
            call()
        assert told.value.hint == "give run= as one of soft, stiff"
    with pytest.raises(leverrier.InvalidArgumentError, match="no value of the run 'mean'"):
        law.rhs(0.0, [1, 0], run="mean")


def test_a_law_of_many_runs_takes_the_numbers_of_one() -> None:
    law = springs()
    for run, k in (("soft", 1.0), ("stiff", 4.0)):
        assert law.rhs(0.0, [1, 0], run=run) == pytest.approx([0, -k], abs=1e-6)
        assert law.energy(0.0, [1, 0], run=run) == pytest.approx(k / 2, abs=1e-6)
        motion = law.predict([1, 0], [0.0, 1.0], run=run)
        assert motion["q"][-1] == pytest.approx(np.cos(np.sqrt(k)), abs=1e-6)
        made = law.simulate([[1, 0]], [0.0, 1.0], run=run)
        assert made["q"][-1] == motion["q"][-1]


def test_a_run_is_no_argument_where_runs_are_alike(pendulum) -> None:
    with pytest.raises(leverrier.InvalidArgumentError, match="no run has numbers of its own"):
        pendulum.rhs(0.0, [1, 0], run="1")


def test_a_driven_law_takes_no_zero_for_its_inputs() -> None:
    law = driven()
    for call in (
        lambda: law.rhs(0.0, [1, 0]),
        lambda: law.energy(0.0, [1, 0]),
        lambda: law.vector_field,
        lambda: law.predict([1, 0], [0.0, 1.0]),
        lambda: law.simulate([[1, 0]], [0.0, 1.0]),
    ):
        with pytest.raises(leverrier.InvalidArgumentError, match="driven by u") as told:
            call()
        assert told.value.hint.startswith("give u=")
    times = np.linspace(0.0, 1.0, 11)
    moved = law.predict([0, 0], times, u=np.ones(11))["q"][-1]
    assert moved == pytest.approx(1 - np.cos(1.0), abs=1e-6)
    made = law.simulate([[0, 0]], times, u=np.ones(11))
    assert made["q"][-1] == moved


SWING = "coordinates q; momenta p; T = p^2/2; V = span{ poly(q; 4) }"


def test_the_estimator_finds_columns_by_their_names(swing) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("sklearn")
    _, X = swing
    turned = pandas.DataFrame({"p": X[:, 1], "q": X[:, 0]})
    estimator = leverrier.HamiltonianEstimator(SWING, dt=0.1).fit(turned)
    assert estimator.terms_ == ["q^2"] and estimator.coef_[0] == pytest.approx(0.5, abs=1e-9)
    assert np.allclose(estimator.predict(turned[:-1]), turned[1:], atol=1e-8)
    assert estimator.score(turned) > 1 - 1e-9
    other = turned.rename(columns={"p": "momentum"})
    with pytest.raises(ValueError, match="the columns of X are momentum, q"):
        leverrier.HamiltonianEstimator(SWING, dt=0.1).fit(other)
    with pytest.raises(ValueError, match="without a spec the coordinates come first"):
        leverrier.HamiltonianEstimator(dt=0.1).fit(turned)


def test_the_estimator_scores_no_steps_between_runs() -> None:
    sklearn = pytest.importorskip("sklearn")
    from sklearn.model_selection import GroupKFold, cross_val_score

    X = np.concatenate([a * np.column_stack([np.cos(T), -np.sin(T)]) for a in (1, 2, 3, 4)])
    run = np.repeat(np.arange(4), len(T))
    estimator = leverrier.HamiltonianEstimator(SWING, dt=0.1)
    with pytest.raises(ValueError, match="fit was given run=, and score was not"):
        estimator.fit(X, run=run).score(X)
    assert estimator.score(X, run=run) > 1 - 1e-6
    with pytest.raises(ValueError, match="enable_metadata_routing"):
        cross_val_score(
            estimator, X, groups=run, cv=GroupKFold(2), params={"run": run}, error_score="raise"
        )
    with sklearn.config_context(enable_metadata_routing=True):
        estimator.set_fit_request(run=True).set_score_request(run=True)
        scores = cross_val_score(
            estimator, X, cv=GroupKFold(2), params={"run": run, "groups": run}
        )
    assert min(scores) > 1 - 1e-6


def test_a_finished_diagnosis_says_so(pendulum) -> None:
    diagnosis = pendulum.diagnose()
    assert diagnosis.verdict == "missing" and diagnosis.interrupted is False


@pytest.mark.skipif(os.name == "nt", reason="signals of Windows are others")
def test_an_interrupted_diagnosis_has_no_verdict() -> None:
    program = """
        import os, signal
        import leverrier

        sent = []
        def progress(stage, fraction):
            if not sent:
                sent.append(stage)
                os.kill(os.getpid(), signal.SIGINT)
        law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        try:
            law.diagnose(progress=progress)
        except KeyboardInterrupt as interrupt:
            best = interrupt.best
            print(best.verdict, best.interrupted, best.missing, best.ranking[0].effect)
            print(best.reason)
    """
    found = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    verdict, reason = found.stdout.splitlines()
    assert verdict == "interrupted True None viscous_drag(q)", found
    assert reason.startswith("interrupted before all was tried") and "viscous_drag(q)" in reason


def test_inputs_go_beside_arrays_everywhere() -> None:
    random = np.random.default_rng(0)
    spec = leverrier.parse(
        "coordinates q; momenta p; input u { linear }; T = p^2/2; V = span{ q^2, q^4 }\n"
        "force q = span{ u }"
    )
    truth = leverrier.parse(
        "coordinates q; momenta p; input u { linear }; T = p^2/2; V = q^2/2\nforce q = u"
    ).known_law()
    made = []
    for start in ([1, 0], [0, 1], [-1, 0.5]):
        u = random.standard_normal(len(T))
        states = truth.predict(start, T, u=u).states
        made.append((states + 1e-3 * random.standard_normal(states.shape), u))
    X, u = [one for one, _ in made], [one for _, one in made]
    law = spec.fit(X[:2], t=0.1, u=u[:2])
    assert law.coefficient("u") == pytest.approx(1.0, abs=0.01)
    last = {"t": T, "u": u[2]}
    assert law.refit(X[2], **last).coefficient("u") == pytest.approx(1.0, abs=0.02)
    assert law.compare(X[2], **last).horizons[-1].held_out < 2
    assert law.diagnose(X[2], **last).verdict == "nothing_missing"
    assert spec.discover(X, t=0.1, u=u).steps == []
    with pytest.raises(leverrier.InvalidArgumentError, match="t, run and u go with X"):
        law.compare(u=u[2])
