"""What a law lacks: where it fails, what is missing, what to measure next, what a change brings."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

from . import _native
from .catalogue import taken_by
from .errors import DataError, InvalidArgumentError, LeverrierError
from .plotting import plotted
from .progress import Progress, finished, shown
from .questions import Judged, diagnosis_options, listed, placed, range_of, ranges, support
from .report import Report, written
from .results import Comparison, Design, Diagnosis, Revision, Rows, unfinished
from .tables import number

if TYPE_CHECKING:
    from .law import Law
    from .spec import Spec
    from .tables import Data


class Judging:
    """The part of :class:`leverrier.Law` that holds it against measurements."""

    _native: _native.Law
    _data: Data | None
    _before: Callable[[], Law] | None
    noise: Rows

    if TYPE_CHECKING:

        @property
        def spec(self) -> Spec: ...

    @property
    def _law(self) -> Law:
        """The law that this is a part of."""
        return cast("Law", self)

    def compare(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Comparison:
        """Where the law fails: errors by length of prediction, drift of the energy, the force that
        is missing.

        With measurements (as :meth:`leverrier.Spec.data` takes them) the law is held against
        these, which it has not seen. Without, its own are split, its numbers learned anew from
        one part and judged on the other.

        >>> import leverrier
        >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        >>> law.compare().horizons[-1].held_out > 3
        True
        """
        return self._compared(
            self._judged(X, t, run, u, held_out, seed, threads, progress), threads
        )

    def diagnose(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        held_out: float = 0.25,
        seed: int = 0,
        correlated_noise: bool = True,
        orbits: int = 0,
        all_pairs: bool = False,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Diagnosis:
        """Which physical effect the law lacks, or that nothing is missing.

        The arguments are those of :meth:`compare`, whether what is left may be noise with a memory,
        such as that of a filter, how many orbits of a body that nobody measures are fitted where
        bodies attract each other, and whether effects on two of twelve coordinates or more are asked
        for also where nothing in the spec couples the two.
        Ctrl-C raises KeyboardInterrupt with the diagnosis so far as its attribute ``best``; its
        ``verdict`` is ``interrupted``.

        >>> import leverrier
        >>> diagnosis = leverrier.open("examples/damped-pendulum/fit.ham").fit().diagnose()
        >>> diagnosis.verdict, diagnosis.missing
        ('missing', 'viscous_drag(q)')
        """
        options = diagnosis_options(correlated_noise, orbits, all_pairs)
        judged = self._judged(X, t, run, u, held_out, seed, threads, progress)
        native = judged.law._native
        both = (judged.training._native, judged.unseen._native)

        def wrapped(found: _native.Diagnosis) -> Diagnosis:
            fields = judged.fields | json.loads(found.json()) | {"interrupted": False}
            return Diagnosis(fields, judged.law, judged.drawing(found))

        def cut_short(found: _native.Diagnosis) -> Diagnosis:
            fields = judged.fields | unfinished(json.loads(found.json()))
            return Diagnosis(fields, judged.law, judged.drawing(found))

        def work(told: Progress | None) -> _native.Diagnosis:
            return native.diagnose(*both, options, threads, told)

        return finished(progress, work, wrapped, cut_short)

    def design(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        between: Sequence[str] = (),
        coefficient: str | None = None,
        within: Mapping[str, Any] | None = None,
        stay: Mapping[str, Any] | None = None,
        start_time: float | None = None,
        duration: Any = None,
        step: Any = None,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Design:
        """Which run to measure next.

        It is the run that best tells apart the effects ``between`` (or those that a diagnosis
        cannot decide between), or that best measures a ``coefficient`` (or the one that is known
        worst). ``within`` says where it may start, ``stay`` what the motion may not leave: a number
        or (lower, upper) for components of the state. So are ``duration`` and ``step``. What is
        left open is as in the measurements so far. The other arguments are those of
        :meth:`compare`.

        >>> import leverrier
        >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        >>> design = law.design(within={"q": (-1, 1), "p": 0}, duration=(5, 20))
        >>> design.start["p"], abs(design.start["q"]) <= 1
        (0.0, True)
        """
        options = {
            "between": [str(name) for name in listed(between)],
            "coefficient": None if coefficient is None else str(coefficient),
            "start": ranges(within, "within"),
            "motion": ranges(stay, "stay"),
            "from": None if start_time is None else number(start_time, "start_time"),
            "duration": None if duration is None else range_of(duration, "duration"),
            "step": None if step is None else range_of(step, "step"),
        }
        judged = self._judged(X, t, run, u, held_out, seed, threads, progress)
        native = judged.law._native
        both = (judged.training._native, judged.unseen._native)
        return finished(
            progress,
            lambda told: native.design(*both, options, threads, told),
            lambda text: Design(judged.fields | json.loads(text), judged.law),
        )

    def add(
        self,
        effect: str,
        *,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Revision:
        """The law with an effect, and whether held-out measurements support it.

        The law and its spec stay as they are; ``add(...).law`` is the new one.

        >>> import leverrier
        >>> revision = leverrier.open("examples/damped-pendulum/fit.ham").fit().add("viscous_drag")
        >>> revision.supported, [term.term for term in revision.law.terms]
        (True, ['cos(q)', '-p'])
        """
        return self._revised(f"add {effect}", self.spec.with_effect(effect), held_out, seed,
                             threads, progress)  # fmt: skip

    def remove(
        self,
        effect: str,
        *,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Revision:
        """The law without an effect or without a term that has a name, and whether held-out
        measurements speak for it: whether their error does not rise by more than 2 %."""
        return self._revised(f"remove {effect}", self.spec.without(effect), held_out, seed,
                             threads, progress)  # fmt: skip

    def _revised(
        self,
        action: str,
        spec: Spec,
        held_out: float,
        seed: int,
        threads: int | None,
        progress: bool | Progress | None,
    ) -> Revision:
        judged = self._judged(None, None, None, None, held_out, seed, threads, progress)
        seen = spec.fit(judged.training, threads=threads, progress=progress)
        after = judged._replace_law(seen)
        compared = seen._compared(after, threads)
        noise = [1.0 if one is None else one for _, one in compared.noise_floor]
        before = judged.law._compared(judged, threads, noise)
        law = spec.fit(self._own(), threads=threads, progress=progress)
        known = {(one.place, one.term) for one in judged.law.terms}
        new = [one.to_dict() for one in seen.terms if (one.place, one.term) not in known]
        supported, reason = support(action, new, before, compared)
        fields = judged.fields | {
            "action": action, "effect": new, "supported": supported, "reason": reason,
        }  # fmt: skip
        law._before = lambda: self._law
        return Revision(fields, law, before, compared)

    def refit(
        self,
        X: Any = None,
        *,
        t: Any = None,
        run: Any = None,
        u: Any = None,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Law:
        """The same terms with their numbers learned anew, from other measurements."""
        data = self.spec.data(X, t=t, run=run, u=u)
        with shown(progress) as told:
            return type(self._law)(self._native.refit(data._native, threads, told), self.spec, data)

    def undo(self) -> Law:
        """The law before the last change: before :meth:`add`, :meth:`remove` or
        :meth:`with_terms`; that of the spec before all that ``discover`` added. A law that was
        pickled, or read from a file, has no past.

        >>> import leverrier
        >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        >>> law.add("viscous_drag").law.undo() == law
        True
        """
        if self._before is None:
            raise InvalidArgumentError(
                "the law came of no change, so there is none to undo",
                "remove(...) takes an effect out of it",
                kind="NothingToDo",
            )
        return self._before()

    def with_terms(
        self,
        terms: Sequence[str] | Mapping[str, Any],
        *,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Law:
        """The law with exactly these terms of its spec, their numbers learned from its own
        measurements: a list of their texts (``law.spec.terms`` has all), or another model of
        ``law.front`` or ``law.runners_up``.

        >>> import leverrier, numpy as np
        >>> t = np.arange(100) * 0.1
        >>> law = leverrier.learn(t, np.cos(t), degree=4, harmonics=0)
        >>> [term.term for term in law.with_terms(["x^2", "x^4"]).terms]
        ['x^2', 'x^4']
        >>> [term.term for term in law.with_terms(law.front[2]).terms]
        ['x', 'x^2']
        """
        wanted = terms.get("terms", ()) if isinstance(terms, Mapping) else terms
        # Runners-up have their coefficients beside the terms.
        wanted = [one[0] if isinstance(one, list) and one else one for one in listed(wanted)]
        model = json.loads(self._native.model_json())
        model["terms"] = placed(wanted, model, self.spec)
        own = len(model["parameters"])
        size = len(model["terms"]) + own
        model["covariance"] = [[0.0] * size for _ in range(size)]
        start = _native.Law.from_model_json(json.dumps(model), self.spec._native)
        data = self._own()
        law = finished(
            progress,
            lambda told: start.refit(data._native, threads, told),
            lambda native: type(self._law)(native, self.spec, data),
        )
        law._before = lambda: self._law
        return law

    def effects(self, *, program: str | os.PathLike[str] = "leverrier") -> Rows:
        """The effects of the catalogue that may be added to the law, one a row: ``effect`` is what
        :meth:`add` takes. The catalogue is that of the program, as for :func:`leverrier.effects`.
        """
        return taken_by(self.spec, program)

    def report(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        diagnose: bool = True,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
        progress: bool | Progress | None = None,
    ) -> Report:
        """A page with the law, where it fails, what it lacks (unless ``diagnose`` is False), its
        measurements and its spec; with a ``path`` it is written there. Notebooks show it.

        The program's ``report`` writes one that tells more, and LaTeX.

        >>> import leverrier
        >>> law = leverrier.open("examples/damped-pendulum/fit.ham").fit()
        >>> law.report(diagnose=False)
        <leverrier.Report: pendulum on a bench: The law, Where it fails, The measurements, The spec>
        """
        options: dict[str, Any] = {"held_out": held_out, "seed": seed, "threads": threads}
        options["progress"] = progress
        comparison = self.compare(**options)
        page = written(self._law, comparison, self.diagnose(**options) if diagnose else None)
        if path is not None:
            page.save(path)
        return page

    def plot(
        self,
        coordinate: str | None = None,
        *,
        run: Any = None,
        held_out: float = 0.25,
        seed: int = 0,
        threads: int | None = None,
    ) -> Any:
        """A figure of matplotlib, where that is installed: the phase portrait of a ``coordinate``
        (the first, if none is named) with the measurements, the error by length of prediction, the
        force on it over phase space, and the force that is missing. ``run`` is as in
        :meth:`predict`, the others as in :meth:`compare`. Notebooks show it;
        ``law.plot().savefig(path)`` writes it.
        """
        try:
            comparison = self.compare(held_out=held_out, seed=seed, threads=threads)
        except DataError:
            comparison = None  # too few, or none at all
        except InvalidArgumentError:
            if self._data is not None:
                raise
            comparison = None
        return plotted(self._law, comparison, coordinate, run)

    def _own(self) -> Data:
        # A law from a file has measurements where its spec names them.
        return self._data if self._data is not None else self.spec.data()

    def _judged(
        self,
        X: Any,
        t: Any,
        run: Any,
        u: Any,
        held_out: float,
        seed: int,
        threads: int | None,
        progress: bool | Progress | None,
    ) -> Judged:
        from .spec import split_fields

        if X is not None:
            training, unseen = self._own(), self.spec.data(X, t=t, run=run, u=u)
            law, terms = self._law, "the law as it is, judged on measurements that were given"
            split = {"training": training.runs, "held_out": unseen.runs}
        else:
            if any(one is not None for one in (t, run, u)):
                raise InvalidArgumentError("t, run and u go with X", "give the measurements, too")
            training, unseen = self._own().split(held_out, seed)
            law = self.refit(training, threads=threads, progress=progress)
            terms = "the terms of the law, their numbers from the training part"
            split = split_fields(training, unseen, held_out, seed)
        fields = {"system": self.spec.system, "split": split, "terms_from": terms}
        return Judged(law, training, unseen, fields)

    def _compared(
        self, judged: Judged, threads: int | None, noise: list[float] | None = None
    ) -> Comparison:
        native = judged.law._native
        text = native.compare(judged.training._native, judged.unseen._native, noise, threads)
        return Comparison(judged.fields | json.loads(text), judged.law, judged.drawing(None))

    def _misfit(self, data: Data | None = None) -> float | None:
        """The error over whole runs of measurements (none: its own), in units of the noise."""
        data = self._data if data is None else data
        if data is None or self._data is None:
            return None
        noise = [one.standard_deviation for one in self.noise]
        try:
            found = self._compared(Judged(self._law, self._data, data, {}), None, noise)
        except LeverrierError:  # too few, or a motion that leaves the finite numbers
            return None
        return found.horizons[-1].held_out if found.horizons else None
