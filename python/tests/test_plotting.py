"""Plots of laws, where matplotlib is installed."""

import pickle
import sys

import numpy as np
import pytest

import leverrier
from leverrier import InvalidArgumentError, NoResultError

T = np.arange(200) * 0.05


def panels(figure) -> dict[str, object]:
    return {axes.get_title(): axes for axes in figure.axes if axes.get_title()}


def test_without_matplotlib_it_says_so(pendulum, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(NoResultError, match="not installed; pip install matplotlib"):
        pendulum.plot()


def test_a_law_is_plotted(pendulum, tmp_path) -> None:
    pytest.importorskip("matplotlib")
    figure = pendulum.plot()
    shown = panels(figure)
    assert list(shown) == [
        "Phase portrait", "Error by length of prediction", "Force on q", "Missing force on q",
    ]  # fmt: skip
    assert "cos(q)" in figure.get_suptitle()
    dots = [line for line in shown["Phase portrait"].lines if line.get_marker() == "."]
    assert sum(len(line.get_xdata()) for line in dots) == pendulum.data.samples
    # What the comparison says is what is drawn.
    held_out = shown["Error by length of prediction"].lines[1].get_ydata()
    assert held_out[-1] == pendulum.compare().horizons[-1].held_out
    assert shown["Missing force on q"].get_xlabel() == "p"
    (mesh,) = shown["Force on q"].collections
    force = np.asarray(mesh.get_array()).reshape(61, 61)
    assert force[0, 0] == pytest.approx(-force[0, -1], rel=0.2) and force[0, 0] > 0.5
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert pickle.loads(pickle.dumps(figure)).get_suptitle() == figure.get_suptitle()
    figure.savefig(tmp_path / "law.png")
    assert (tmp_path / "law.png").stat().st_size > 10_000


def test_positions_alone_and_other_coordinates_are_plotted() -> None:
    pytest.importorskip("matplotlib")
    x = np.column_stack([np.cos(T), 0.5 * np.cos(1.7 * T)])
    x += 0.001 * np.random.default_rng(0).standard_normal(x.shape)
    law = leverrier.learn(T, x)
    portrait = panels(law.plot("y"))["Phase portrait"]
    assert (portrait.get_xlabel(), portrait.get_ylabel()) == ("y", "p_y")
    assert portrait.lines[0].get_label() == "measured (momenta of differences)"
    assert np.ptp(portrait.lines[0].get_ydata()) == pytest.approx(2 * 0.85, rel=0.1)
    with pytest.raises(InvalidArgumentError, match="no coordinate `z`; there are x, y"):
        law.plot("z")


def test_velocities_are_turned_into_momenta() -> None:
    pytest.importorskip("matplotlib")
    law = leverrier.learn(T, np.cos(T), v=-np.sin(T), masses=3.0)
    portrait = panels(law.plot())["Phase portrait"]
    assert np.allclose(portrait.lines[0].get_ydata(), -3 * np.sin(T), atol=1e-6)
    assert portrait.lines[0].get_label() == "measured"


def test_laws_of_runs_driven_and_known_laws_are_plotted() -> None:
    pytest.importorskip("matplotlib")
    X = [np.column_stack([np.cos(w * T), -w * np.sin(w * T)]) for w in (1.0, 2.0)]
    spec = leverrier.parse(
        "coordinates q; momenta p; param k per run in 0.5..9; T = p^2/2; V = k*q^2/2"
    )
    law = spec.fit(X, t=T, run=["soft", "stiff"])
    dots = panels(law.plot(run="stiff"))["Phase portrait"].lines[0]
    assert np.allclose(dots.get_ydata(), X[1][:, 1])
    assert np.allclose(panels(law.plot())["Phase portrait"].lines[0].get_ydata(), X[0][:, 1])
    with pytest.raises(InvalidArgumentError, match="no value of the run 'other'"):
        law.plot(run="other")
    driven = leverrier.parse(
        "coordinates q; momenta p; input u { hold }; T = p^2/2; V = q^2/2; force q = span{ u }"
    )
    u = np.sin(3 * T)
    truth = leverrier.parse(driven.text.replace("span{ u }", "u")).known_law()
    law = driven.fit(truth.predict([1, 0], T, u=u).states, t=T, u=u)
    assert panels(law.plot())["Force on q"].collections
    known = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = q^2/2").known_law().plot()
    said = panels(known)["Error by length of prediction"].texts[0].get_text()
    assert said == "no measurements to compare with"
