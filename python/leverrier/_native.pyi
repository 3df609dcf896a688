"""The extension module: the library's façade, thin."""

import numpy as np
from collections.abc import Callable
from typing import Any, TypeAlias

__version__: str

_Numbers: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]
_Cells: TypeAlias = _Numbers | list[str] | tuple[str, int]
_Progress: TypeAlias = Callable[[str, float], object] | None

class Spec:
    text: str
    system: str
    coordinates: list[str]
    momenta: list[str]
    inputs: list[str]
    observables: list[str]
    terms: list[str]
    warnings: list[str]
    @staticmethod
    def open(path: str) -> Spec: ...
    @staticmethod
    def parse(text: str) -> Spec: ...
    def with_effect(self, effect: str) -> Spec: ...
    def without(self, effect: str) -> Spec: ...
    def known_law(self) -> Law: ...
    def fit(
        self, data: Data, options: dict[str, Any], threads: int | None, progress: _Progress
    ) -> Law: ...
    def discover(
        self,
        training: Data,
        held_out: Data,
        options: tuple[dict[str, Any], dict[str, Any], bool],
        threads: int | None,
        progress: _Progress,
    ) -> tuple[str, Law, Spec]: ...

class Data:
    samples: int
    observables: list[str]
    runs: list[str]
    warnings: list[str]
    @staticmethod
    def open(spec: Spec, path: str | None = None) -> Data: ...
    @staticmethod
    def empty(spec: Spec) -> Data: ...
    @staticmethod
    def from_columns(
        spec: Spec,
        columns: list[tuple[str, _Cells]],
        time: str | None = None,
        run: str | None = None,
    ) -> Data: ...
    @staticmethod
    def from_samples(
        spec: Spec, times: _Numbers, runs: _Cells | None, columns: list[_Numbers]
    ) -> Data: ...
    def split(self, held_out: float, seed: int) -> tuple[Data, Data]: ...
    def report_json(self) -> str: ...
    def times(self, run: int) -> _Numbers: ...
    def values(self, run: int, observable: str) -> _Numbers: ...

class Law:
    @staticmethod
    def open(path: str, spec: Spec) -> Law: ...
    @staticmethod
    def from_model_json(text: str, spec: Spec) -> Law: ...
    def save(self, path: str) -> None: ...
    def model_json(self) -> str: ...
    def hamiltonian_json(self) -> str: ...
    def equations(self) -> str: ...
    def exported(self, format: str) -> str: ...
    def to_rust(self, folder: str) -> None: ...
    def to_c(self, folder: str) -> None: ...
    def vector_field(self) -> VectorField: ...
    def predict(
        self,
        start: list[float],
        times: list[float],
        inputs: tuple[list[float], list[list[float]]] | None,
    ) -> tuple[_Numbers, _Numbers, str, float]: ...
    def refit(self, data: Data, threads: int | None, progress: _Progress) -> Law: ...
    def compare(
        self, training: Data, held_out: Data, noise: list[float] | None, threads: int | None
    ) -> str: ...
    def diagnose(
        self,
        training: Data,
        held_out: Data,
        options: dict[str, Any],
        threads: int | None,
        progress: _Progress,
    ) -> Diagnosis: ...
    def figures(
        self, training: Data, held_out: Data, diagnosis: Diagnosis | None
    ) -> list[tuple[str, str, str, str]]: ...
    def design(
        self,
        training: Data,
        held_out: Data,
        options: dict[str, Any],
        threads: int | None,
        progress: _Progress,
    ) -> str: ...

class Diagnosis:
    def json(self) -> str: ...

class VectorField:
    def rates(self, time: float, states: _Numbers) -> _Numbers: ...
    def energies(self, time: float, states: _Numbers) -> _Numbers: ...

def survey_part(
    spec: Spec, part: Data | str, number: int, sampling: tuple[int, int], threads: int | None
) -> bytes: ...
def pass_part(
    spec: Spec,
    part: Data | str,
    request: bytes,
    place: tuple[int, int, int, int],
    threads: int | None,
) -> bytes: ...
def merge_parts(first: bytes, second: bytes) -> bytes: ...
def fit_parts(
    spec: Spec,
    engine: Any,
    options: dict[str, Any],
    threads: int | None,
    progress: _Progress,
) -> tuple[Law, Data]: ...
