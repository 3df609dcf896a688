"""What a law says: predictions, rates, expressions, judgements."""

import copy
import pickle

import numpy as np
import pytest

import leverrier


def test_the_fields_of_the_model_file_are_attributes(pendulum) -> None:
    assert pendulum.evidence.runs == 8 and pendulum.stop.reason == "converged"
    assert pendulum.terms[0].place == "V" and pendulum.noise[0].observable == "q"
    assert pendulum.covariance.shape == (1, 1)
    assert "evidence" in dir(pendulum)
    with pytest.raises(AttributeError, match="no attribute 'colour'"):
        pendulum.colour
    with pytest.raises(AttributeError, match="there are"):
        pendulum.evidence.colour


def test_rates_are_those_that_others_integrate(pendulum) -> None:
    integrate = pytest.importorskip("scipy.integrate")
    times = np.linspace(0.0, 10.0, 51)
    own = pendulum.predict([1.0, 0.0], times).states
    for vectorized in (False, True):
        found = integrate.solve_ivp(
            pendulum.rhs, (0.0, 10.0), [1.0, 0.0], method="DOP853", t_eval=times, rtol=1e-12,
            atol=1e-12, vectorized=vectorized,
        )  # fmt: skip
        assert np.allclose(found.y.T, own, atol=1e-9)
    energies = pendulum.energy(0.0, own.T)
    assert np.ptp(energies) < 1e-11 and isinstance(pendulum.energy(0.0, own[0]), float)


def test_expressions_agree_with_rates(pendulum) -> None:
    sympy = pytest.importorskip("sympy")
    found = pendulum.to_sympy()
    q, p = found.symbols["q"], found.symbols["p"]
    rate = sympy.lambdify((q, p), found.velocities.__class__(found.velocities + found.accelerations))
    assert np.allclose(rate(0.7, 0.2), pendulum.rhs(0.0, [0.7, 0.2]), rtol=1e-12)
    assert sympy.diff(found.energy, p) - found.velocities[0] == 0


def test_pickle_and_copies_keep_the_model(pendulum) -> None:
    for again in (pickle.loads(pickle.dumps(pendulum)), copy.deepcopy(pendulum)):
        assert again.model.to_dict() == pendulum.model.to_dict()
        assert np.array_equal(again.rhs(0.0, [0.3, 0.1]), pendulum.rhs(0.0, [0.3, 0.1]))


def test_a_model_file_is_read_back(pendulum, tmp_path) -> None:
    pendulum.save(tmp_path / "swings.model.json")
    again = pendulum.spec.law(tmp_path / "swings.model.json")
    assert again.model.to_dict() == pendulum.model.to_dict()
    # Its measurements are where its spec says.
    assert again.compare().horizons[-1].held_out > 3.0


def test_it_is_written_for_notebooks_and_papers(pendulum, tmp_path) -> None:
    assert "<table>" in pendulum._repr_html_() and "cos" in pendulum._repr_latex_()
    assert pendulum._repr_latex_().startswith("$$") and "\\cos" in pendulum.to_latex()
    assert "documentclass" in pendulum.to_latex(document=True)
    assert "<math" in pendulum.to_mathml() and "sympy" in pendulum.to_python()
    pendulum.to_rust(tmp_path / "rust")
    assert (tmp_path / "rust" / "Cargo.toml").exists()


def test_the_missing_drag_is_found_and_added(pendulum) -> None:
    pytest.importorskip("pandas")
    comparison = pendulum.compare()
    assert comparison.horizons[-1].held_out > 3.0 and comparison.split.held_out
    assert "held_out" in comparison.to_pandas().columns and "<li>" in comparison._repr_html_()
    diagnosis = pendulum.diagnose()
    assert diagnosis.missing == "viscous_drag(q)" and diagnosis.story[0].p_value < 1e-6
    assert diagnosis.to_pandas()["effect"][0] == "viscous_drag(q)"
    assert "viscous_drag" in diagnosis._repr_html_()
    revision = pendulum.add(diagnosis.missing)
    assert revision.supported and len(revision.law.terms) == 2
    assert revision.after.horizons[-1].held_out < 1.5 < revision.before.horizons[-1].held_out
    assert revision.law.diagnose().verdict == "nothing_missing"
    back = revision.law.remove("viscous_drag(q)")
    assert back.supported is False and len(back.law.terms) == 1


def test_a_law_is_judged_on_measurements_that_it_has_not_seen(pendulum) -> None:
    training, unseen = pendulum.spec.data().split(0.25, seed=3)
    law = pendulum.spec.fit(training)
    assert law.compare(unseen).horizons[-1].held_out > 3.0
    assert law.diagnose(unseen).missing == "viscous_drag(q)"


def test_discovery_ends_at_the_noise(pendulum) -> None:
    found = pendulum.spec.discover()
    assert [step.effect for step in found.steps] == ["viscous_drag(q)"]
    assert found.verdict == "nothing_missing" and "viscous_drag" in found.spec.text
    assert len(found.law.terms) == 2 and "viscous_drag" in found._repr_html_()


def test_the_next_run_tells_two_drags_apart(pendulum) -> None:
    two = ["viscous_drag", "coulomb_friction"]
    design = pendulum.design(between=two, within={"q": (0.4, 1.1), "p": 0}, step=0.1)
    assert 0.4 <= design.start["q"] <= 1.1 and design.start["p"] == 0.0
    assert {rival.effect for rival in design.rivals} == {f"{name}(q)" for name in two}
    assert np.allclose(np.diff(design.times), 0.1) and len(design.times) == design.best.samples
    assert "tell" in design.why or "distinguish" in design.why
    assert "viscous_drag" in repr(design) and "<table" in design._repr_html_()
    worst = pendulum.design(coefficient="cos(q)", duration=10, start_time=0.0)
    assert worst.coefficient.what == "cos(q)" and worst.best.duration == pytest.approx(10, rel=0.02)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"within": {"r": 1}}, "no component `r`"),
        ({"within": {"q": (1, 2, 3)}}, "lower, upper"),
        ({"within": {"q": (2, 1)}}, "empty"),
        ({"within": 3}, "dictionary"),
        ({"duration": -1}, "positive"),
        ({"step": "long"}, "number"),
        ({"between": "viscous_drag"}, "two or more"),
        ({"between": ["viscous_drag", "viscous_drag"]}, "named twice"),
        ({"coefficient": "sin(q)"}, "sin"),
    ],
)
def test_a_run_that_cannot_be_asked_for_is_said(pendulum, asked, said) -> None:
    with pytest.raises(leverrier.LeverrierError, match=said) as error:
        pendulum.design(**asked)
    assert error.value.hint


def test_a_known_law_has_nothing_to_judge() -> None:
    law = leverrier.parse("coordinates q; momenta p\nT = p^2/2\nV = q^2/2").known_law()
    assert law.predict([1.0, 0.0], [0.0, np.pi])["q"][-1] == pytest.approx(-1.0, abs=1e-12)
    assert "q" in law._repr_html_() and pickle.loads(pickle.dumps(law)).spec == law.spec
    with pytest.raises(leverrier.InvalidArgumentError):
        law.terms
    with pytest.raises(leverrier.LeverrierError):
        law.compare(np.zeros((5, 2)), t=0.1)


def test_results_do_not_depend_on_threads(pendulum) -> None:
    again = pendulum.spec.fit(threads=1)
    assert again.model.to_dict() == pendulum.spec.fit(threads=2).model.to_dict()


def test_the_stubs_name_what_is_there() -> None:
    import ast
    from pathlib import Path

    from leverrier import _native

    folder = Path(leverrier.__file__).parent
    assert (folder / "py.typed").exists()
    stub = ast.parse((folder / "_native.pyi").read_text(encoding="utf-8"))
    classes = [node for node in stub.body if isinstance(node, ast.ClassDef)]
    assert {node.name for node in classes} == {"Spec", "Data", "Law", "Diagnosis", "VectorField"}
    for node in classes:
        told = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
        told |= {part.target.id for part in node.body if isinstance(part, ast.AnnAssign)}
        made = {name for name in vars(getattr(_native, node.name)) if not name.startswith("_")}
        assert told == made, node.name


def test_results_show_the_figures_of_the_report(pendulum, tmp_path) -> None:
    comparison = pendulum.compare()
    assert {"horizons", "predictions", "forces"} <= {one.plot for one in comparison.figures}
    shown = comparison._repr_html_()
    assert shown.count("data:image/svg+xml;base64,") >= 3
    figure = next(one for one in comparison.figures if one.plot == "horizons")
    figure.save(tmp_path / "horizons.svg")
    assert (tmp_path / "horizons.svg").read_text(encoding="utf-8").startswith("<svg")
    # Pickled, they are what they were but for figures.
    again = pickle.loads(pickle.dumps(comparison))
    assert again.to_dict() == comparison.to_dict() and again.figures == comparison.figures[:0]


def test_pickled_laws_compare_equal(pendulum) -> None:
    import pickle

    again = pickle.loads(pickle.dumps(pendulum))
    assert again == pendulum and hash(again) == hash(pendulum) and len({again, pendulum}) == 1
    spec = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2")
    assert spec.known_law() == spec.known_law() != pendulum
