"""Equations of motion from measured trajectories.

Give measurements of positions and momenta (or velocities) over time, and say in a *spec* which
terms the energy might have: a sparse Hamiltonian comes back, with an uncertainty on every
coefficient, and the name of what it lacks.

>>> import numpy as np
>>> import leverrier
>>> t = np.arange(200) * 0.1
>>> print(leverrier.learn(t, np.cos(t)))
H = p_x^2/2 + x^2/2

What is known of a system, and what may be, is said in a spec:

>>> spec = leverrier.open("examples/damped-pendulum/fit.ham")
>>> law = spec.fit()
>>> law.diagnose().missing
'viscous_drag(q)'
>>> better = law.add("viscous_drag(q)")
>>> better.supported
True
>>> round(float(better.law.predict([1.0, 0.0], [0.0, 0.5, 1.0])["q"][-1]), 2)
0.61
"""

from __future__ import annotations

from ._native import __version__
from .catalogue import effects
from .errors import (
    DataError,
    Diagnostic,
    FileError,
    InvalidArgumentError,
    LeverrierError,
    LeverrierWarning,
    ModelError,
    NoResultError,
    SpecError,
)
from .law import Law
from .learning import learn
from .motion import Trajectory, VectorField
from .report import Report
from .results import (
    Comparison,
    Design,
    Diagnosis,
    Discovery,
    Figure,
    Record,
    Revision,
    Table,
)
from .spec import Spec, open, parse
from .tables import Data

__all__ = [
    "Comparison",
    "Data",
    "DataError",
    "Design",
    "Diagnosis",
    "Diagnostic",
    "Discovery",
    "Figure",
    "FileError",
    "HamiltonianEstimator",
    "InvalidArgumentError",
    "Law",
    "LeverrierError",
    "LeverrierWarning",
    "ModelError",
    "NoResultError",
    "Record",
    "Report",
    "Revision",
    "Spec",
    "SpecError",
    "Table",
    "Trajectory",
    "VectorField",
    "__version__",
    "effects",
    "learn",
    "open",
    "parse",
]


def __getattr__(name: str) -> object:
    # scikit-learn is imported by those who use the estimator.
    if name == "HamiltonianEstimator":
        from .estimator import HamiltonianEstimator

        return HamiltonianEstimator
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
