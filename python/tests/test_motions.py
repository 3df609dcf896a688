"""Motions: many at a time, into the past, and driven."""

import numpy as np
import pytest

import leverrier
from leverrier import InvalidArgumentError

T = np.arange(101) * 0.1

SPECS = {
    "a spring": "coordinates q; momenta p; T = p^2/2; V = q^2/2 + q^4/4",
    "drag": "coordinates q; momenta p; T = p^2/2; V = -cos(q)\nforce q = -0.1*p",
    "time": "coordinates q; momenta p; T = p^2/2; V = q^2/2 - q*cos(2*t)",
    "a star": "coordinates x, y; momenta p, r; T = (p^2 + r^2)/2\n"
    "V = (x^2 + y^2)/2 + x^2*y - y^3/3",
    "no separation": "coordinates q; momenta p; H = p^2/(2*(1 + q^2)) + q^2/2",
}


@pytest.mark.parametrize("text", SPECS.values(), ids=SPECS)
def test_the_past_leads_to_the_present(text) -> None:
    law = leverrier.parse(text).known_law()
    start = np.full(2 * len(law.spec.coordinates), 0.3)
    there = law.predict(start, T)
    back = law.predict(there.states[-1], T[::-1])
    assert back.t[0] == T[-1] and back.names == there.names
    assert np.allclose(back.states[::-1], there.states, atol=1e-10)
    assert back.method == "gragg-bulirsch-stoer"
    if text in (SPECS["a spring"], SPECS["a star"]):
        assert back.energy_drift < 1e-12


def test_one_goes_back_in_one_step_too() -> None:
    law = leverrier.parse(SPECS["a spring"]).known_law()
    there = law.predict([1, 0], [0.0, 50.0]).states[-1]
    assert np.allclose(law.predict(there, [50.0, 0.0]).states[-1], [1, 0], atol=1e-9)


def test_a_past_that_is_infinite_is_told() -> None:
    law = leverrier.parse("coordinates q; momenta p; T = p^2/2; V = -q^4").known_law()
    with pytest.raises(leverrier.NoResultError, match="cannot be followed back beyond") as told:
        law.predict([1, -1], [0.0, -10.0])
    assert told.value.hint


def test_a_law_of_runs_goes_back_with_the_numbers_of_one() -> None:
    X = [np.column_stack([np.cos(w * T), -w * np.sin(w * T)]) for w in (1.0, 2.0)]
    spec = leverrier.parse(
        "coordinates q; momenta p; param k per run in 0.5..9; T = p^2/2; V = k*q^2/2"
    )
    law = spec.fit(X, t=0.1, run=["soft", "stiff"])
    back = law.predict([1, 0], [0.0, -1.0], run="stiff")
    assert back["q"][-1] == pytest.approx(np.cos(2.0), abs=1e-6)
    with pytest.raises(InvalidArgumentError, match="another value"):
        law.predict([1, 0], [0.0, -1.0])


def test_many_starts_are_a_list_of_motions() -> None:
    law = leverrier.parse(SPECS["drag"]).known_law()
    starts = np.array([[1.0, 0.0], [0.5, 0.2], [0.0, -1.0]])
    for times in (T, T[::-1]):
        motions = law.predict(starts, times)
        assert len(motions) == 3
        for start, motion in zip(starts, motions):
            assert np.array_equal(motion.states, law.predict(start, times).states)
    named = law.predict({"p": starts[:, 1], "q": starts[:, 0]}, T)
    assert [motion.states[0].tolist() for motion in named] == starts.tolist()
    assert law.predict(np.zeros((0, 2)), T) == []


DRIVEN = (
    "coordinates q; {second} p; input u {{ {kind} }}; input w {{ hold }}\n"
    "param m = 2 in 0.1..9; T = {momentum}^2/(2*m); V = q^2/2 - sin(u)*q\n"
    "force q += -0.1*abs({momentum})*{momentum} + w*exp(-u^2)/(1 + q^2) + t*sqrt(u^2 + 1)"
)


def driven(kind: str = "linear", velocities: bool = False) -> leverrier.Law:
    second, momentum = ("velocities", "p_q") if velocities else ("momenta", "p")
    return leverrier.parse(DRIVEN.format(second=second, momentum=momentum, kind=kind)).known_law()


def test_rates_of_a_driven_law_take_the_inputs() -> None:
    law = driven()
    integrate = pytest.importorskip("scipy.integrate")
    knots = np.column_stack([np.sin(T), np.full(len(T), 0.3)])
    wanted = law.predict([1.0, 0.0], T, u=knots).states

    def inputs(t: float) -> list[float]:
        return [np.interp(t, T, knots[:, 0]), 0.3]

    found = integrate.solve_ivp(
        lambda t, z: law.rhs(t, z, u=inputs), (0.0, 10.0), [1.0, 0.0], t_eval=T, rtol=1e-9,
        atol=1e-10, max_step=0.05,
    )  # fmt: skip
    assert np.allclose(found.y.T, wanted, atol=1e-6)
    states = wanted[:5].T
    each = np.column_stack([law.rhs(0.5, state, u=[0.2, 0.3]) for state in states.T])
    assert np.allclose(law.rhs(0.5, states, u=[0.2, 0.3]), each)
    both = np.array([[0.2] * 5, [0.3] * 5])
    assert np.allclose(law.rhs(0.5, states, u=both), each)
    energies = law.energy(0.0, states, u=[0.2, 0.3])
    assert energies.shape == (5,) and isinstance(law.energy(0.0, states[:, 0], u=[0.2, 0.3]), float)
    q, p = states
    assert np.allclose(energies, p**2 / 4 + q**2 / 2 - np.sin(0.2) * q)


def test_a_learned_driven_law_has_rates() -> None:
    u = np.sin(3 * T) + np.cos(1.1 * T)
    one = leverrier.parse(
        "coordinates x; momenta p; input u { linear }; T = p^2/2; V = x^2; force x = 0.7*u"
    ).known_law()
    law = leverrier.learn(T, one.predict([1.0, 0.0], T, u=u).states[:, 0], u=u)
    assert np.allclose(law.rhs(0.0, [1.0, 0.5], u=2.0), [0.5, -2 + 1.4], atol=1e-3)


@pytest.mark.parametrize(
    ("u", "said"),
    [
        (1.0, "give a number for each of u, w"),
        ([1.0], "shape (1,)"),
        ([1.0, 2.0, 3.0], "shape (3,)"),
        ([[1.0], [2.0]], "shape (2, 1)"),
        ("much", "not numbers"),
        (lambda t: None, "u"),
    ],
    ids=str,
)
def test_inputs_that_do_not_fit_are_told(u, said) -> None:
    with pytest.raises(leverrier.LeverrierError) as told:
        driven().rhs(0.0, [1.0, 0.0], u=u)
    assert said in str(told.value) and told.value.hint


def test_other_states_of_a_driven_law_are_told() -> None:
    with pytest.raises(InvalidArgumentError, match="z has the shape"):
        driven().rhs(0.0, [1.0], u=[0, 0])
    with pytest.raises(InvalidArgumentError, match="not followed into the past"):
        driven().predict([1, 0], [1.0, 0.0], u=np.zeros((2, 2)), t_u=[0.0, 1.0])
    with pytest.raises(InvalidArgumentError, match="t_u has the shape"):
        driven().predict([1, 0], [0.0, 1.0], u=np.zeros((2, 2)), t_u=[[0.0, 1.0]])
    late = leverrier.parse(
        "coordinates q; momenta p; input u { linear }; T = p^2/2; V = q^2/2\nforce q = delayed(u, 0.1)"
    ).known_law()
    with pytest.raises(leverrier.LeverrierError) as told:
        late.rhs(0.0, [1.0, 0.0], u=1.0)
    assert told.value.hint


@pytest.mark.parametrize("kind", ["hold", "linear"])
def test_velocities_of_a_driven_law_are_simulated(kind) -> None:
    law = driven(kind, velocities=True)
    assert law.spec.observables == ["q", "p"]
    at = T[::10]
    u = np.column_stack([np.sin(at), np.cos(at)])
    made = law.simulate([[1.0, 0.0]], T, u=u, t_u=at)
    motion = law.predict([1.0, 0.0], T, u=u, t_u=at)
    assert np.array_equal(made["q"], motion["q"])
    assert np.allclose(made["p"], motion["p_q"] / 2)
    other = driven("spline", velocities=True)
    with pytest.raises(InvalidArgumentError, match="`u` is spline between its samples"):
        other.simulate([[1.0, 0.0]], T, u=u, t_u=at)
    assert len(other.simulate([[1.0, 0.0]], at, u=u)) == len(at)
