"""An estimator by the conventions of scikit-learn."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted, validate_data

from . import tables
from .law import Law
from .spec import Spec, parse
from .spec import open as open_spec

__all__ = ["HamiltonianEstimator"]


class HamiltonianEstimator(BaseEstimator):
    """Learns a law of motion from samples of states, as an estimator of scikit-learn.

    Rows of ``X`` are states: coordinates, then momenta. It predicts the state that follows a state
    after ``dt``. Where ``X`` has names for its columns and a spec is given, the columns are found by
    these names, in any order.

    Parameters
    ----------
    spec : Spec, str or None
        What is known and what is to be learned: a spec, its text, or the name of a file that ends
        in ``.ham``. None: every pair of columns is a coordinate and its momentum with the kinetic
        energy p^2/2, and the potential is a polynomial of the coordinates.
    dt : float
        Time between samples, where ``fit`` is given no times.
    degree : int
        Degree of that polynomial.
    select, loss, starts, seed, threads
        As in :meth:`leverrier.Spec.fit`.

    Attributes
    ----------
    law_ : Law
        What was learned.
    spec_ : Spec
        The spec that it was learned of.
    coef_ : ndarray
        Coefficients of the terms that were chosen.
    terms_ : list of str
        These terms.
    n_features_in_ : int
        Columns of ``X``.

    Examples
    --------
    >>> import numpy as np
    >>> from leverrier import HamiltonianEstimator
    >>> t = np.arange(100) * 0.1
    >>> X = np.column_stack([np.cos(t), -np.sin(t)])
    >>> estimator = HamiltonianEstimator(dt=0.1).fit(X)
    >>> estimator.terms_, estimator.coef_.round(6).tolist()
    (['q[1]^2'], [0.5])
    >>> round(estimator.score(X), 6)
    1.0
    """

    def __init__(
        self,
        spec: Spec | str | None = None,
        *,
        dt: float = 1.0,
        degree: int = 4,
        select: str = "information",
        loss: str = "squares",
        starts: int = 8,
        seed: int = 0,
        threads: int | None = None,
    ) -> None:
        self.spec = spec
        self.dt = dt
        self.degree = degree
        self.select = select
        self.loss = loss
        self.starts = starts
        self.seed = seed
        self.threads = threads

    def fit(self, X: Any, y: Any = None, *, t: Any = None, run: Any = None) -> HamiltonianEstimator:
        """Learns the law. ``t`` has the time of every row (or the time step), ``run`` its run;
        ``y`` is not used."""
        X = self._checked(X, reset=True)
        self.spec_ = self._spec(X.shape[1])
        self.order_ = self._order(X.shape[1])
        X = X[:, self.order_]
        self.fitted_with_ = [name for name, value in (("t", t), ("run", run)) if value is not None]
        data = self.spec_.data(X, t=self.dt if t is None else t, run=run)
        self.law_ = self.spec_.fit(
            data, select=self.select, loss=self.loss, starts=self.starts, seed=self.seed,
            threads=self.threads, progress=False,
        )  # fmt: skip
        self.terms_ = [one.term for one in self.law_.terms]
        self.coef_ = np.asarray([one.coefficient for one in self.law_.terms], dtype=np.float64)
        return self

    def predict(self, X: Any) -> np.ndarray:
        """The states that follow these after ``dt``."""
        check_is_fitted(self)
        X = self._checked(X, reset=False, complete=True)[:, self.order_]
        times = [0.0, float(self.dt)]
        ends = np.asarray([self.law_.predict(state, times).states[-1] for state in X])
        # In the order of the columns of X.
        return ends[:, np.argsort(self.order_)]

    def score(self, X: Any, y: Any = None, *, t: Any = None, run: Any = None) -> float:
        """R^2 of the motion from every sample to the next of its run, over all components: 1 is a
        law without error, 0 one that is no better than the mean change. ``y`` is not used.

        What ``fit`` was given of ``t`` and ``run``, ``score`` needs, too: scikit-learn's functions
        hand it on only with metadata routing, and steps from one run to the next are no motion."""
        check_is_fitted(self)
        for name, value in (("t", t), ("run", run)):
            if value is None and name in self.fitted_with_:
                raise ValueError(
                    f"fit was given {name}=, and score was not: give it {name}=, in scikit-learn's "
                    "functions by sklearn.set_config(enable_metadata_routing=True) and "
                    f"set_fit_request({name}=True).set_score_request({name}=True)"
                )
        X = self._checked(X, reset=False)[:, self.order_]
        data = tables.data(self.spec_, X, self.dt if t is None else t, run)._native
        squares, spread = 0.0, 0.0
        for number in range(len(data.runs)):
            columns = [data.values(number, name) for name in data.observables]
            states, times = np.column_stack(columns), data.times(number)
            known = np.isfinite(states).all(axis=1)
            states, times = states[known], times[known]
            ends = zip(states[:-1], times[:-1], times[1:])
            of = data.runs[number] if self.law_._is_fitted and self.law_.distributions else None
            moved = [self.law_.predict(a, [b, c], run=of).states[-1] for a, b, c in ends]
            if not moved:
                continue
            change = np.diff(states, axis=0)
            squares += float(np.sum((np.asarray(moved) - states[1:]) ** 2))
            spread += float(np.sum((change - change.mean(axis=0)) ** 2))
        return 1.0 - squares / spread if spread > 0 else float("nan")

    def _checked(self, X: Any, *, reset: bool, complete: bool = False) -> np.ndarray:
        finite: Any = True if complete else "allow-nan"
        return validate_data(
            self, X, dtype=np.float64, ensure_all_finite=finite, ensure_min_samples=1 if complete else 2, reset=reset
        )  # fmt: skip

    def _order(self, columns: int) -> np.ndarray:
        """Where the columns of X stand that the spec names, in the spec's order."""
        as_they_are = np.arange(columns)
        found = getattr(self, "feature_names_in_", None)
        if found is None:
            return as_they_are
        names = [str(name) for name in found]
        half = columns // 2
        if self.spec is None:
            first, second = ({name[:1].lower() for name in part} for part in (names[:half], names[half:]))
            if "p" in first and "q" in second:
                raise ValueError(
                    f"the columns of X are {', '.join(names)}: without a spec the coordinates come "
                    "first, then their momenta in the same order; give X so, or a spec"
                )
            return as_they_are
        observables = self.spec_.observables
        for wanted in (observables, observables[: len(observables) // 2]):
            if sorted(names) == sorted(wanted):
                return np.asarray([names.index(name) for name in wanted])
        raise ValueError(
            f"the columns of X are {', '.join(names)}, and the spec is about {', '.join(observables)}: "
            "rename them, or give X.to_numpy() with the columns in the spec's order"
        )

    def _spec(self, columns: int) -> Spec:
        if isinstance(self.spec, Spec):
            return self.spec
        if isinstance(self.spec, str):
            return open_spec(self.spec) if self.spec.endswith(".ham") else parse(self.spec)
        if self.spec is not None:
            raise ValueError(f"spec={self.spec!r} is no spec: give a Spec, its text, or a .ham file")
        if columns % 2:
            raise ValueError(
                f"X has {columns} feature(s), which are no pairs of coordinates and momenta: "
                "give a spec that says what they are"
            )
        degrees = columns // 2
        kinetic = " + ".join(f"p[{i}]^2/2" for i in range(1, degrees + 1))
        return parse(
            f"coordinates q[1..{degrees}]; momenta p[1..{degrees}]\n"
            f"T = {kinetic}\nV = span{{ poly(q; {int(self.degree)}) }}"
        )

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.target_tags.required = False
        return tags
