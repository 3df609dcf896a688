"""An estimator by the conventions of scikit-learn."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from . import tables
from .errors import LeverrierWarning
from .spec import Spec, parse
from .spec import open as open_spec
from .times import Names

__all__ = ["HamiltonianEstimator"]


class HamiltonianEstimator(BaseEstimator):
    """Learns a law of motion from samples of states, as an estimator of scikit-learn.

    Rows of ``X`` are states: coordinates, then momenta. It predicts the state that follows a state
    after ``dt``. Where ``X`` has names for its columns and a spec is given, the columns are found by
    these names, in any order. Measured inputs stand beside, as ``u``, a column for each; in a
    prediction they hold their value for the step. Without a spec an odd last column of ``X`` is
    such an input, too, of which ``LeverrierWarning`` tells.

    Parameters
    ----------
    spec : Spec, str or None
        What is known and what is to be learned: a spec, its text, or the name of a file that ends
        in ``.ham``. None: every pair of columns is a coordinate and its momentum with the kinetic
        energy p^2/2, the potential is a polynomial of the coordinates, and a last column without
        a partner, and those of ``u``, are inputs that may drive every coordinate.
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

    def fit(
        self, X: Any, y: Any = None, *, t: Any = None, run: Any = None, u: Any = None
    ) -> HamiltonianEstimator:
        """Learns the law. ``t`` has the time of every row (or the time step), ``run`` its run,
        ``u`` its measured inputs (rows without one are left out); ``y`` is not used."""
        X = self._checked(X, reset=True)
        given = None if u is None else self._columns(u, len(X))
        columns = X.shape[1]
        # Without a spec what has no partner is no coordinate.
        self.driven_ = self.spec is None and columns % 2 == 1 and columns > 1
        if self.driven_:
            warnings.warn(
                f"X has {columns} columns: {columns // 2} pairs of coordinates and momenta, and "
                "the last is taken for a measured input; give a spec to say otherwise",
                LeverrierWarning,
                stacklevel=2,
            )
        inputs = int(self.driven_) + (0 if given is None else given.shape[1])
        self.spec_ = self._spec(columns - int(self.driven_), inputs)
        self.order_ = self._order(columns - int(self.driven_))
        states, driving = self._parted(X, given)
        told = {"t": t, "run": run, "u": u}
        self.fitted_with_ = [name for name, value in told.items() if value is not None]
        times = self.dt if t is None else t
        if driving is not None and not np.isfinite(driving).all():
            # A row without its input tells nothing; the times of the others stay.
            times = tables._times(times, len(states), run, Names(self.spec_).unit)
            known = np.isfinite(driving).all(axis=1)
            states, driving, times = states[known], driving[known], times[known]
            run = None if run is None else np.asarray(run)[known]
        data = self.spec_.data(states, t=times, run=run, u=driving)
        self.law_ = self.spec_.fit(
            data, select=self.select, loss=self.loss, starts=self.starts, seed=self.seed,
            threads=self.threads, progress=False,
        )  # fmt: skip
        self.terms_ = [one.term for one in self.law_.terms]
        self.coef_ = np.asarray([one.coefficient for one in self.law_.terms], dtype=np.float64)
        return self

    def predict(self, X: Any, *, u: Any = None) -> np.ndarray:
        """The states that follow these after ``dt``, of the same columns but for inputs; NaN
        after a row in which something is missing. ``u`` has the inputs of every row, which they
        hold for the step."""
        check_is_fitted(self)
        X = self._checked(X, reset=False, alone=True)
        states, driving = self._parted(X, None if u is None else self._columns(u, len(X)))
        times = [0.0, float(self.dt)]
        known = np.isfinite(states).all(axis=1)
        known &= True if driving is None else np.isfinite(driving).all(axis=1)
        ends = np.full(states.shape, np.nan)
        for row in np.flatnonzero(known):
            held = None if driving is None else driving[[row, row]]
            ends[row] = self.law_.predict(states[row], times, u=held).states[-1]
        # In the order of the columns of X.
        return ends[:, np.argsort(self.order_)]

    def score(
        self, X: Any, y: Any = None, *, t: Any = None, run: Any = None, u: Any = None
    ) -> float:
        """R^2 of the motion from every sample to the next of its run, over all components: 1 is a
        law without error, 0 one that is no better than the mean change. ``y`` is not used.

        What ``fit`` was given of ``t``, ``run`` and ``u``, ``score`` needs, too: scikit-learn's
        functions hand it on only with metadata routing, and steps from one run to the next are no
        motion."""
        check_is_fitted(self)
        for name, value in (("t", t), ("run", run), ("u", u)):
            if value is None and name in self.fitted_with_:
                raise ValueError(
                    f"fit was given {name}=, and score was not: give it {name}=, in scikit-learn's "
                    "functions by sklearn.set_config(enable_metadata_routing=True) and "
                    f"set_fit_request({name}=True).set_score_request({name}=True)"
                )
        X = self._checked(X, reset=False)
        states, driving = self._parted(X, None if u is None else self._columns(u, len(X)))
        squares, spread = 0.0, 0.0
        for name, rows, times in self._runs(states, self.dt if t is None else t, run):
            known = np.isfinite(states[rows]).all(axis=1)
            known &= True if driving is None else np.isfinite(driving[rows]).all(axis=1)
            rows, times = rows[known], times[known]
            of = name if self.law_._is_fitted and self.law_.distributions else None
            moved = []
            for here, there, begin, end in zip(rows[:-1], rows[1:], times[:-1], times[1:]):
                both = None if driving is None else driving[[here, there]]
                motion = self.law_.predict(states[here], [begin, end], u=both, run=of)
                moved.append(motion.states[-1])
            if not moved:
                continue
            change = np.diff(states[rows], axis=0)
            squares += float(np.sum((np.asarray(moved) - states[rows[1:]]) ** 2))
            spread += float(np.sum((change - change.mean(axis=0)) ** 2))
        return 1.0 - squares / spread if spread > 0 else float("nan")

    def _runs(
        self, states: np.ndarray, t: Any, run: Any
    ) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
        """Every run by name, its rows in the order of time, and their times."""
        times = tables._times(t, len(states), run, Names(self.spec_).unit)
        names = np.full(len(states), "1") if run is None else tables._one_dimensional(
            run, len(states), "run"
        ).astype(str)  # fmt: skip
        for name in dict.fromkeys(names.tolist()):
            rows = np.flatnonzero(names == name)
            rows = rows[np.argsort(times[rows], kind="stable")]
            yield name, rows, times[rows]

    def _parted(self, X: np.ndarray, u: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """The states in the spec's order, and the inputs beside them."""
        inputs = [] if u is None else [u]
        if self.driven_:
            X, inputs = X[:, :-1], [X[:, -1:], *inputs]
        if not inputs and self.spec_.inputs:
            raise ValueError(
                f"the law is driven by {', '.join(self.spec_.inputs)}: give u= with a column for each"
            )
        return X[:, self.order_], np.hstack(inputs) if inputs else None

    @staticmethod
    def _columns(u: Any, rows: int) -> np.ndarray:
        u = check_array(u, dtype=np.float64, ensure_2d=False, ensure_all_finite="allow-nan")
        u = u[:, None] if u.ndim == 1 else u
        if u.shape[0] != rows:
            raise ValueError(f"u has {u.shape[0]} rows, and X {rows}: give the inputs of every row")
        return u

    def _checked(self, X: Any, *, reset: bool, alone: bool = False) -> np.ndarray:
        return validate_data(
            self, X, dtype=np.float64, ensure_all_finite="allow-nan",
            ensure_min_samples=1 if alone else 2, reset=reset,
        )  # fmt: skip

    def _order(self, columns: int) -> np.ndarray:
        """Where the columns of X stand that the spec names, in the spec's order."""
        as_they_are = np.arange(columns)
        found = getattr(self, "feature_names_in_", None)
        if found is None:
            return as_they_are
        names = [str(name) for name in found][:columns]
        half = columns // 2
        if self.spec is None:
            first, second = (
                {name[:1].lower() for name in part} for part in (names[:half], names[half:])
            )
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

    def _spec(self, columns: int, inputs: int) -> Spec:
        if isinstance(self.spec, Spec):
            return self.spec
        if isinstance(self.spec, str):
            return open_spec(self.spec) if self.spec.endswith(".ham") else parse(self.spec)
        if self.spec is not None:
            raise ValueError(
                f"spec={self.spec!r} is no spec: give a Spec, its text, or a .ham file"
            )
        if columns % 2:
            raise ValueError(
                f"X has {columns} feature(s), which are no pairs of coordinates and momenta: "
                "give a spec that says what they are"
            )
        degrees = range(1, columns // 2 + 1)
        kinetic = " + ".join(f"p[{i}]^2/2" for i in degrees)
        names = [f"u{i}" for i in range(1, inputs + 1)]
        driven = [f"input {name} {{ hold }}" for name in names]
        forces = [f"force q[{i}] += span{{ {', '.join(names)} }}" for i in degrees if names]
        lines = [
            f"coordinates q[1..{len(degrees)}]; momenta p[1..{len(degrees)}]", *driven,
            f"T = {kinetic}", f"V = span{{ poly(q; {int(self.degree)}) }}", *forces,
        ]  # fmt: skip
        return parse("\n".join(lines))

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.target_tags.required = False
        return tags
