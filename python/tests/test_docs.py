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


def test_the_readme_runs() -> None:
    text = (ROOT / "python/README.md").read_text(encoding="utf-8")
    blocks = [block.split("```")[0] for block in text.split("```python\n")[1:]]
    if not importlib.util.find_spec("distributed"):
        blocks = [block for block in blocks if "from distributed" not in block]
    assert len(blocks) >= 2
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "python/README.md", "exec"), names)
    assert names["law"].coefficient("-p") > 0.04
