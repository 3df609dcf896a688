"""What the tests share. They run from the repository's root, where the examples are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import leverrier

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def at_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.fixture
def oscillator() -> leverrier.Spec:
    return leverrier.parse("coordinates q; momenta p\nT = p^2/2\nV = span{ poly(q; 4) }")


@pytest.fixture
def swing() -> tuple[np.ndarray, np.ndarray]:
    """Times and states of a harmonic motion."""
    t = np.arange(80) * 0.1
    return t, np.column_stack([np.cos(t), -np.sin(t)])


@pytest.fixture(scope="session")
def pendulum() -> leverrier.Law:
    """A law that knows of no drag, of swings that had one."""
    return leverrier.open(ROOT / "examples/damped-pendulum/fit.ham").fit()
