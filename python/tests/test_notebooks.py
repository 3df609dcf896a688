"""The notebooks run from top to bottom."""

import pytest

from .conftest import ROOT

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
pytest.importorskip("matplotlib")

NOTEBOOKS = sorted((ROOT / "examples/notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    client = nbclient.NotebookClient(
        notebook,
        timeout=300,
        startup_timeout=300,
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute()
    shown = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("text/html" in output.get("data", {}) for output in shown)


def test_there_are_two() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["missing-drag", "your-own-data"]


def test_the_held_out_swing_was_held_out(pendulum) -> None:
    comparison = pendulum.compare()
    revision = pendulum.add("viscous_drag(q)")
    unseen = comparison.split.held_out
    assert unseen == revision.after.split.held_out
    for law in (comparison.law, revision.after.law):
        assert not set(law.data.runs) & set(unseen)
    text = (ROOT / "examples/notebooks/missing-drag.ipynb").read_text(encoding="utf-8")
    for line in ("comparison.law, revision.after.law", "comparison.split.held_out[0]"):
        assert line in text
