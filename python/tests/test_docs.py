"""Every example of a docstring runs, and so does the README's."""

import doctest
import importlib
import importlib.util
import pkgutil

import pytest

import leverrier

from .conftest import ROOT

MODULES = [
    f"leverrier.{one.name}"
    for one in pkgutil.iter_modules(leverrier.__path__)
    if one.name != "_native"
]


@pytest.mark.parametrize("name", ["leverrier", *MODULES])
def test_the_examples_of_a_module_run(name: str) -> None:
    module = importlib.import_module(name)
    found = doctest.testmod(module, optionflags=doctest.ELLIPSIS, extraglobs={"__name__": name})
    assert found.failed == 0


def test_there_are_examples() -> None:
    finder = doctest.DocTestFinder(exclude_empty=True)
    examples = [
        one for name in ["leverrier", *MODULES]
        for one in finder.find(importlib.import_module(name)) if one.examples
    ]  # fmt: skip
    assert len(examples) > 20


READMES = ["README.md", "python/README.md"]


def blocks(page: str, language: str) -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return [block.split("```")[0] for block in text.split(f"```{language}\n")[1:]]


@pytest.mark.parametrize("page", READMES)
def test_a_readme_runs(page) -> None:
    found = blocks(page, "python")
    if not importlib.util.find_spec("distributed"):
        found = [block for block in found if "from distributed" not in block]
    assert found
    names: dict[str, object] = {}
    for block in found:
        exec(compile(block, page, "exec"), names)
    assert names["law" if "python" in page else "better"].coefficient("-p") > 0.04


@pytest.mark.parametrize("page", READMES)
def test_a_readme_shows_what_comes(page) -> None:
    sessions = "\n".join(blocks(page, "pycon"))
    assert "leverrier.learn(t, x)" in sessions
    test = doctest.DocTestParser().get_doctest(sessions, {}, page, page, 0)
    assert doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test).failed == 0
