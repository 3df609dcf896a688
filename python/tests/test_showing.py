"""What laws, data and results show, and what is asked of a law beside its numbers."""

import os
import re
import stat
import sys

import numpy as np
import pytest

import leverrier
from leverrier import InvalidArgumentError, NoResultError

T = np.arange(100) * 0.1


@pytest.fixture(scope="session")
def drag(pendulum) -> leverrier.Revision:
    return pendulum.add("viscous_drag(q)")


def test_a_law_shows_its_numbers_with_their_errors(pendulum, drag) -> None:
    lines = repr(pendulum).splitlines()
    assert lines[0] == "H = p^2/2 - cos(q)"
    assert lines[2].split() == ["place", "term", "coefficient", "standard", "error"]
    assert lines[3].split() == ["V", "cos(q)", "-0.9959", "0.0024"]
    assert lines[-1] == "learned from 968 samples in 8 runs; noise: q 0.007, p 0.0098"
    assert "viscous_drag_q: -p" in repr(drag.law) and repr(drag).startswith("add viscous_drag(q): ")
    known = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2").known_law()
    assert repr(known) == "<leverrier.Law: H = p^2/2 + q^2/2>"


def test_parameters_units_and_the_unmeasured_are_shown() -> None:
    spec = leverrier.parse(
        "coordinates q [m]; momenta p [kg*m/s]; time t [s]; param m = 1 [kg] in 0.1..10\n"
        "T = p^2/(2*m); V = span{ q^2 }"
    )
    law = spec.fit(np.column_stack([np.cos(T), -2 * np.sin(T)]), t=T)
    assert "param  m" in repr(law) and "kg" in repr(law) and "unit" in repr(law)
    law = leverrier.learn(T, np.cos(T))
    assert "p_x" not in repr(law).splitlines()[-1]


def test_notebooks_show_equations(pendulum, drag) -> None:
    shown = drag.law._repr_html_()
    assert "$$\\begin{aligned}" in shown and "\\cos" in shown and "<table>" in shown
    assert drag.law._repr_latex_() in shown.replace("&amp;", "&")
    assert "0.0024" in pendulum._repr_html_()


def test_data_and_results_show_their_numbers(pendulum) -> None:
    data = repr(pendulum.data)
    assert data.startswith("<leverrier.Data: 968 samples of q, p in 8 runs>\ncolumn")
    assert "-1.23381" in data and "<table>" in pendulum.data._repr_html_()
    comparison = repr(pendulum.compare())
    # What the sentence says stands in the table, too.
    said = re.search(r"- the error grows from .* to ([\d.]+) over (\d+)\n", comparison)
    assert said is not None
    row = re.search(rf"^ +{said[2]} .*$", comparison, re.MULTILINE)
    assert row is not None and abs(float(row[0].split()[2]) - float(said[1])) <= 0.005
    assert "9.16981" in row[0]
    diagnosis = repr(pendulum.diagnose())
    assert diagnosis.startswith("missing: viscous_drag(q) takes the error")
    assert "0.05002 ± 0.00014" in diagnosis and "< 1e-12" in diagnosis
    assert repr(pendulum.terms[0]).startswith("Record(place='V', term='cos(q)', name=None, coeff")
    assert "-0.995935" in repr(pendulum.terms) and "[2 entries]" in repr(pendulum.model)
    motion = repr(pendulum.predict([1, 0], T))
    assert motion.splitlines()[0].split() == ["t", "q", "p"] and motion.endswith("100 rows")


def test_changes_are_undone(pendulum, drag) -> None:
    assert drag.law.undo() is pendulum
    back = drag.law.remove("viscous_drag(q)").law
    assert back.undo() is drag.law
    found = pendulum.spec.discover()
    assert found.law.undo() == pendulum.spec.fit(found.law.data)
    with pytest.raises(InvalidArgumentError, match="came of no change") as told:
        pendulum.undo()
    assert told.value.kind == "NothingToDo" and told.value.hint


def test_another_model_of_the_front_is_taken() -> None:
    random = np.random.default_rng(0)
    X = np.column_stack([np.cos(T), -np.sin(T)]) + 0.01 * random.standard_normal((100, 2))
    spec = leverrier.parse(
        "coordinates q; momenta p; T = p^2/2; V = span{ poly(q; 4) }\nforce q = span{ drag: -p }"
    )
    law = spec.fit(X, t=T)
    for other in (law.front[2], law.runners_up[0], ["q^2", "q^4"], ["q^2", "-p"]):
        wanted = other["terms"] if isinstance(other, leverrier.Record) else other
        names = [one if isinstance(one, str) else one[0] for one in wanted]
        taken = law.with_terms(other)
        assert [term.term for term in taken.terms] == names
        assert all(term.standard_error > 0 for term in taken.terms) and taken.undo() is law
    assert law.with_terms([term.term for term in law.terms]).coefficient("q^2") == pytest.approx(
        law.coefficient("q^2"), rel=1e-6
    )
    # In the place where the spec has it.
    assert law.with_terms(["q^2", "-p"]).terms[1].place == "force q"
    for wrong, said in (
        (["q^9"], "no term `q\\^9`; it has q"), (["q", "q"], "named twice"), ([], "no term is named"),
        (3, "no list"), ([7], "no term `7`"), ({}, "no term is named"),
    ):  # fmt: skip
        with pytest.raises(InvalidArgumentError, match=said):
            law.with_terms(wrong)


def test_a_report_is_a_page(pendulum, tmp_path) -> None:
    page = pendulum.report(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert text == page.html and text.startswith("<!DOCTYPE html>")
    for part in ("<math", "0.0024", "Where it fails", "viscous_drag(q)", "data:image/svg", "span{"):
        assert part in text
    # Nothing is loaded from elsewhere.
    assert 'src="http' not in text and "href=" not in text
    assert "What it lacks" not in pendulum.report(diagnose=False).html
    assert "<h2>" in page._repr_html_() and "What it lacks" in repr(page)
    with pytest.raises(leverrier.FileError, match="cannot be written"):
        page.save(tmp_path / "nowhere" / "page.html")
    known = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2").known_law()
    with pytest.raises(leverrier.LeverrierError):
        known.report()


def test_a_spec_is_saved(tmp_path) -> None:
    spec = leverrier.learn(T, np.cos(T)).spec
    spec.save(tmp_path / "swing.ham")
    assert leverrier.open(tmp_path / "swing.ham").text == spec.text
    with pytest.raises(leverrier.FileError, match="cannot be written"):
        spec.save(tmp_path / "nowhere" / "swing.ham")


PROGRAM = """#!{python}
import json, sys
names = ["viscous_drag", "relative_damping", "sensor_offset"]
effects = [{{"name": name, "kind": "k", "physics": "p", "telltale": "t"}} for name in names]
if sys.argv[1:] == ["effects", "--format", "json"]:
    print(json.dumps({{"effects": effects}}))
elif sys.argv[1:] == ["effects", "viscous_drag", "--format", "json"]:
    print(json.dumps({{"effect": effects[0]}}))
else:
    sys.stderr.write(json.dumps({{"message": "there is no effect", "hint": "list them"}}))
    sys.exit(1)
"""


@pytest.mark.skipif(os.name == "nt", reason="a script is no program there")
def test_the_catalogue_is_that_of_the_program(pendulum, tmp_path) -> None:
    program = tmp_path / "leverrier"
    program.write_text(PROGRAM.format(python=sys.executable), encoding="utf-8")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    assert [one.name for one in leverrier.effects(program=program)][0] == "viscous_drag"
    assert leverrier.effects("viscous_drag", program=program).kind == "k"
    with pytest.raises(InvalidArgumentError, match="there is no effect; list them"):
        leverrier.effects("nonsense", program=program)
    taken = [one.effect for one in pendulum.effects(program=program)]
    assert taken == ["viscous_drag", "sensor_offset(q)", "sensor_offset(p)"]
    for effect in taken:
        pendulum.spec.with_effect(effect)
    program.write_text(f"#!{sys.executable}\nprint('nothing')", encoding="utf-8")
    with pytest.raises(NoResultError, match="lists no effects"):
        leverrier.effects(program=program)


def test_without_the_program_the_catalogue_is_not_there(pendulum) -> None:
    for call in (leverrier.effects, pendulum.effects):
        with pytest.raises(NoResultError, match="there is no `nowhere`") as told:
            call(program="nowhere")
        assert "cargo install" in told.value.hint
