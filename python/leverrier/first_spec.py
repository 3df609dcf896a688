"""The spec that is written for those who have none: what is known, and what is on offer."""

from __future__ import annotations

import numpy as np

from .errors import InvalidArgumentError

#: The range of a coordinate from which on its sine is told from a polynomial, and the way from one
#: sample to the next up to which the sine is followed.
_ANGLE = 1.0
_TURN = np.pi


def potential(
    names: list[str], runs: list[np.ndarray], degree: int | None, harmonics: int | None
) -> str:
    """The function space of the potential."""
    for name, value, least in (("degree", degree, 1), ("harmonics", harmonics, 0)):
        known = value is None or isinstance(value, (int, np.integer)) and least <= value <= 12
        if not known or isinstance(value, bool):
            raise InvalidArgumentError(
                f"{name} is {value!r}", f"give a whole number from {least} to 12"
            )
    count = len(names)
    degree = (4 if count <= 3 else 3 if count <= 5 else 2) if degree is None else int(degree)
    items = [f"poly({', '.join(names)}; {degree})"]
    for at, name in enumerate(names):
        several = int(_is_wide([one[:, at] for one in runs])) if harmonics is None else harmonics
        items += [f"trig({name}; {int(several)})"] if several else []
    return ", ".join(items)


def _is_wide(runs: list[np.ndarray]) -> bool:
    """Whether a coordinate may be an angle: it moves far, though not from one sample to the next."""
    known = [one[np.isfinite(one)] for one in runs]
    values = np.concatenate(known)
    steps = np.concatenate([np.abs(np.diff(one)) for one in known])
    return bool(steps.size) and float(np.ptp(values)) > _ANGLE and float(np.median(steps)) < _TURN


class System:
    """What is known of the system before the fit, and the text of its spec."""

    def __init__(
        self,
        names: list[str],
        measured: str,
        momenta: bool,
        masses: list[float] | None,
        inputs: int,
    ) -> None:
        self.names = names
        self.measured = measured
        self.are_momenta = momenta
        self.masses = masses
        self.inputs = ["u"] if inputs == 1 else [f"u{i}" for i in range(1, inputs + 1)]

    @property
    def open_masses(self) -> list[str]:
        """Coordinates whose masses are to be learned."""
        if self.masses is not None:
            return []
        return self.names if self.are_momenta else self.names[1:]

    def _units(self, fixed: set[str]) -> str:
        told = f"the mass of {self.names[0]} is the unit of mass"
        rest = [name for name in self.names if name in fixed]
        return f"{told}, and that of {', '.join(rest)} taken for one" if rest else told

    def text(self, space: str, drag: bool, fixed: set[str]) -> str:
        """The spec, with the masses of ``fixed`` taken as 1."""
        momenta = [f"p_{name}" for name in self.names]
        measured = (
            [f"v_{name}" for name in self.names] if self.measured == "velocities" else momenta
        )
        learned = [name for name in self.open_masses if name not in fixed]
        parts = []
        for at, (name, momentum) in enumerate(zip(self.names, momenta)):
            if name in learned:
                parts.append(f"{momentum}^2/(2*m_{name})")
            elif self.masses is None or self.masses[at] == 1.0:
                parts.append(f"{momentum}^2/2")
            else:
                parts.append(f"{momentum}^2/(2*{self.masses[at]!r})")
        lines = [
            "# Written by leverrier.learn, and yours to edit.",
            f"coordinates {', '.join(self.names)}",
            f"{self.measured:<11} {', '.join(measured)}",
        ]
        taken = {*self.names, *momenta, *measured, *self.inputs}
        if "t" in taken:
            clock = next(name for name in ("clock", "instant", "moment") if name not in taken)
            lines.append(f"time        {clock}")
        lines += [f"input {name} {{ linear }}" for name in self.inputs]
        lines += [f"param m_{name} = 1 in 0.0001..10000" for name in learned]
        kinetic = f"T = {' + '.join(parts)}"
        if not self.are_momenta and self.masses is None:
            kinetic = f"{kinetic:<24} # {self._units(fixed)}"
        lines += [kinetic, f"V = span{{ {space} }}"]
        for name in self.names:
            forces = [f"drag_{name}: -rate({name})"] if drag else []
            forces += self.inputs
            if forces:
                lines.append(f"force {name} += span{{ {', '.join(forces)} }}")
        return "\n".join(lines) + "\n"
