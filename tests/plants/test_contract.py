"""What holds for every plant: one set of tests, run over all of them.

Periodic motion against transient motion, slopes against finite differences, energy, the translation to CasADi;
and, for the linear plant, everything against its closed form. A plant that is added is added to ``BENCHES``.
What is slow, the rig's motions above all, is left to the slow tests.
"""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import PortKind
from savgs_ident.effects.effect import generic_effects
from savgs_ident.plants.at_rest import find_rest, nominal_inputs, standing
from savgs_ident.plants.axis import Axis
from savgs_ident.plants.base import AbstractPlant, Excitation, Motion, state_sizes
from savgs_ident.plants.profiles import ProfileSource, Sine
from savgs_ident.plants.quarter_car.model import RigModel, load_rig
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass, closed_form
from savgs_ident.simulate.collocation import node_motion
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.periodic import PeriodicSolution, resolve, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import harmonic_sensitivities
from savgs_ident.simulate.transient import simulate_transient
from savgs_ident.symbolic.translate import to_casadi

from ..relaxed import as_users_have_it

STEP = 1e-5
"""Relative step of finite differences."""


@dataclass(frozen=True)
class Bench:
    """A plant with its parameters, and what drives it in two dwells: the amplitude of each input [its unit].

    ``varied`` are the parameters in which slopes of harmonics are compared; the first three within bounds if empty.
    """

    plant: AbstractPlant
    table: ParameterTable
    amplitudes: tuple[float, ...]
    frequency: tuple[float, ...]
    varied: tuple[str, ...] = ()

    @property
    def p(self) -> Values:
        return as_values(self.table.as_dict())

    @property
    def excitation(self) -> Excitation:
        """The dwells: a sine in every input, about its value at rest."""
        harmonics = {}
        for given, amplitude in zip(self.plant.inputs, self.amplitudes, strict=True):
            rest = self.table[given.rest].value if given.rest else 0.0
            row = np.array([rest, amplitude], complex)
            harmonics[given.name] = jnp.asarray(np.tile(row, (len(self.frequency), 1)))
        return Excitation(jnp.asarray(self.frequency), harmonics)

    def solution(self, p: Values | None = None) -> PeriodicSolution:
        found = simulate_periodic(self.plant, p or self.p, self.excitation)
        assert all(status.ok for status in found.status())
        return found


def _with_effects(plant: AbstractPlant, *names: str) -> tuple[AbstractPlant, ParameterTable]:
    """A plant with generic effects, and their parameters at typical sizes."""
    catalogue = generic_effects(plant.ports)
    own = ParameterTable(())
    for name in names:
        plant, own = plant + catalogue[name], own + ParameterTable(catalogue[name].parameters)
    return plant, own


def _two_mass(*effects: str) -> Bench:
    plant, own = _with_effects(TwoMass(), *effects)
    return Bench(plant, PARAMETERS + own, (0.01,), (1.3, 4.0))


def _axis(*effects: str) -> Bench:
    plant, own = _with_effects(Axis(), *effects)
    parameters = Axis.parameters.with_values({"holding": 1e4})
    return Bench(plant, parameters + own, (200.0,), (0.7, 2.5))


def _quarter_car(*effects: str) -> Bench:
    model = RigModel(load_rig(), effects)
    return Bench(model.build(), model.table, (0.01375, 0.0), (2.35, 4.0), (*model.free(), "m_s"))


BENCHES = {
    "axis": _axis(),
    "axis with dry friction and a stiffening screw": _axis("guide_coulomb", "screw_stiffening"),
    "two_mass": _two_mass(),
    "two_mass with friction, stiffening and a soft mount": _two_mass(
        "suspension_friction", "tyre_stiffening", "mount_compliance"
    ),
    "quarter_car": _quarter_car(),
    "quarter_car that sticks on its rail": _quarter_car("rail_coulomb", "tyre_friction"),
}


def _benches(*slow: str) -> list[Any]:
    """All of them, those with names among ``slow`` left to the slow tests."""
    return [
        pytest.param(bench, id=name, marks=pytest.mark.slow if name in slow else ())
        for name, bench in BENCHES.items()
    ]


BARE = tuple(name for name, bench in BENCHES.items() if not bench.plant.effects)
RIG = tuple(name for name in BENCHES if name.startswith("quarter_car"))
AT_INSTANTS = _benches("quarter_car")
"""Where equations are compared, the rig without friction is slow: the other one has all its terms."""
AT_REST = _benches(*RIG)
"""Where a state of rest is solved for, the rig is slow."""
AXIS = tuple(name for name in BENCHES if name.startswith("axis"))
MOVED = _benches(*BARE, *RIG, *AXIS)
"""Where motions are solved, all are slow but one that has friction, a spring and something in series."""


@pytest.fixture(scope="module", params=AT_INSTANTS)
def bench(request: pytest.FixtureRequest) -> Bench:
    found: Bench = request.param
    return found


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> object:
    with as_users_have_it():
        yield


def _instant(bench: Bench, seed: int) -> tuple[Motion, Array, Array]:
    """A random motion with random internal states and rates, of typical sizes."""
    rng = np.random.default_rng(seed)
    plant = bench.plant
    sizes = [
        [getattr(each, name) for each in plant.coordinates]
        for name in ("size", "rate_size", "acceleration_size")
    ]
    motion = Motion(
        *(plant.coordinate_type(*jnp.asarray(np.array(s) * rng.standard_normal(len(s)))) for s in sizes)
    )
    scale = np.array([each.scale for each in plant.states])
    states, rates = (jnp.asarray(scale * rng.standard_normal(scale.size)) for _ in range(2))
    return motion, states, rates


def test_it_declares_what_it_takes_and_gives(bench: Bench) -> None:
    plant = bench.plant
    n = len(plant.coordinates)
    assert len(plant.coordinate_type._fields) == n
    assert all(len(each.moves) == n for each in plant.inputs)
    assert len({port.name for port in plant.ports}) == len(plant.ports)
    sensors = {port.location for port in plant.ports if port.kind is PortKind.SENSOR}
    assert sensors == {f"sensor.{each.name}" for each in plant.channels}
    motion, s, sd = _instant(bench, 0)
    u = nominal_inputs(plant, bench.p)
    assert plant.residual(bench.p, motion, s, sd, u).shape == (n + len(plant.states),)
    assert len(plant.read(bench.p, motion, s, sd, u)) == len(plant.channels)
    assert len(state_sizes(plant)) == 2 * n + len(plant.states)


@pytest.mark.parametrize("bench", AT_REST, indirect=True)
def test_at_rest_nothing_is_out_of_balance(bench: Bench) -> None:
    plant, p = bench.plant, bench.p
    u = nominal_inputs(plant, p)
    rest = find_rest(plant, p, u)
    balance = plant.residual(p, standing(plant, rest.q), rest.s, jnp.zeros_like(rest.s), u)
    motion, s, sd = _instant(bench, 1)
    typical = np.abs(np.asarray(plant.residual(p, motion, s, sd, u)))
    assert np.max(np.abs(np.asarray(balance)) / typical.max()) < 1e-8


def test_the_residual_has_the_slopes_of_differences(bench: Bench) -> None:
    """In every parameter that moves it, at a random instant."""
    plant, p = bench.plant, bench.p
    motion, s, sd = _instant(bench, 2)
    u = nominal_inputs(plant, p)
    names = tuple(name for name in p if float(p[name]) != 0.0)

    @jax.jit
    def residual(values: Array) -> Array:
        return plant.residual({**p, **dict(zip(names, values, strict=True))}, motion, s, sd, u)

    at = jnp.asarray([p[name] for name in names])
    slopes = np.asarray(jax.jacfwd(residual)(at))
    for place in range(len(names)):
        step = STEP * float(jnp.abs(at[place]))
        ahead, behind = (residual(at.at[place].add(sign * step)) for sign in (1.0, -1.0))
        differences = np.asarray(ahead - behind) / (2.0 * step)
        size = np.max(np.abs(slopes[:, place])) + 1e-9 * np.max(np.abs(np.asarray(residual(at)))) / step
        assert np.max(np.abs(differences - slopes[:, place])) < 1e-5 * size, names[place]


@pytest.mark.slow
@pytest.mark.parametrize("bench", MOVED, indirect=True)
def test_harmonics_have_the_slopes_of_differences(bench: Bench) -> None:
    """On the same nodes, by small steps: friction shows where nodes are moved, or where one no longer slides."""
    plant, p = bench.plant, bench.p
    own = [each.name for each in bench.table.entries if each.lower < each.value < each.upper][:3]
    names = bench.varied or tuple(own)
    solution = bench.solution()
    slopes = np.asarray(harmonic_sensitivities(plant, p, solution, names, 3))
    for place, name in enumerate(names):
        step = 1e-5 * float(p[name])
        sides = []
        for sign in (1.0, -1.0):
            q = as_values({**p, name: float(p[name]) + sign * step})
            sides.append(np.asarray(harmonics(plant, q, resolve(plant, q, solution), 3)))
        differences = (sides[0] - sides[1]) / (2.0 * step)
        size = np.max(np.abs(slopes[place]), axis=(0, 2), keepdims=True)
        assert np.max(np.abs(differences - slopes[place]) / size) < 1e-3, name


@pytest.mark.parametrize("bench", MOVED, indirect=True)
def test_periodic_and_transient_motions_agree(bench: Bench) -> None:
    """After the transient has died away, over the last period of the faster dwell."""
    plant, p, frequency = bench.plant, bench.p, bench.frequency[-1]
    rests = [bench.table[each.rest].value if each.rest else 0.0 for each in plant.inputs]
    source = ProfileSource(
        tuple(
            Sine(amplitude, frequency, rest, 0.0, 0.5)
            for amplitude, rest in zip(bench.amplitudes, rests, strict=True)
        )
    )
    times = np.concatenate([[0.0], (40.0 + np.arange(256) / 256.0) / frequency])
    found = simulate_transient(plant, p, source, times, tolerance=1e-8)
    assert found.status().ok
    wanted = np.asarray(harmonics(plant, p, bench.solution(), 3))[-1]
    for channel, reading in enumerate(found.readings):
        seen = np.fft.rfft(np.asarray(reading)[1:])[1:4] * 2.0 / 256.0
        assert np.max(np.abs(seen - wanted[channel, 1:])) < 5e-3 * abs(wanted[channel, 1])


@pytest.mark.parametrize("bench", MOVED, indirect=True)
def test_no_force_at_a_port_brings_energy_over_a_period(bench: Bench) -> None:
    """Neither those of effects nor the plant's own: what they take is what the inputs bring."""
    plant, p, solution = bench.plant, bench.p, bench.solution()
    ports = [each for each in plant.ports if each.kind is PortKind.FORCE]
    inputs = inputs_at(plant, solution.excitation, solution.mesh)

    @jax.jit
    @jax.vmap
    def powers(u: Any, *parts: Array) -> Array:
        motion, s, sd = node_motion(plant, parts)
        at = plant.at_ports(p, motion, s, sd, u)
        each = [port.sense * at.forces[port.name] * at.signals[port.name].velocity for port in ports]
        return jnp.stack(each)

    along = np.asarray(powers(inputs, *solution.trajectory.x, *solution.trajectory.y))
    weighted = along * np.asarray(solution.mesh.weight)[:, None]
    brought = np.add.reduceat(weighted, solution.mesh.layout.starts, axis=0)
    assert np.max(brought) <= 1e-4 * np.max(np.abs(along))
    assert np.all(np.min(brought, axis=1) < -1e-3 * np.max(np.abs(along))) or not plant.effects


def test_its_equations_are_the_same_in_casadi(bench: Bench) -> None:
    plant, p = bench.plant, bench.p
    n, names = len(plant.coordinates), tuple(p)

    def residual(x: Array, s: Array, sd: Array, values: Array) -> Array:
        motion = Motion(*(plant.coordinate_type(*jnp.unstack(x[i : i + n])) for i in range(0, 3 * n, n)))
        q = dict(zip(names, jnp.unstack(values), strict=True))
        return plant.residual(q, motion, s, sd, nominal_inputs(plant, q))

    motion, s, sd = _instant(bench, 3)
    x = np.concatenate([np.asarray(jnp.stack(part)) for part in motion])
    arguments = {
        "x": x,
        "s": np.asarray(s),
        "sd": np.asarray(sd),
        "p": np.array([float(p[n]) for n in names]),
    }
    casadi = to_casadi("residual", residual, arguments, ["residual"])
    expected = np.asarray(residual(*(jnp.asarray(each) for each in arguments.values())))
    found = np.array(casadi(*arguments.values())).ravel()
    assert np.max(np.abs(found - expected)) < 1e-10 * np.max(np.abs(expected))


def test_the_linear_plant_answers_as_its_closed_form_says() -> None:
    """To the error of the nodes, in each of many dwells about both resonances."""
    frequency = np.geomspace(0.5, 15.0, 12)
    bench = Bench(TwoMass(), PARAMETERS, (0.01,), tuple(frequency))
    found = np.asarray(harmonics(bench.plant, bench.p, bench.solution(), 3))
    wanted = 0.01 * closed_form(PARAMETERS.as_dict(), frequency)
    assert np.max(np.abs(found[:, :, 1] - wanted) / np.abs(wanted)) < 1e-3
    higher: NDArray[np.float64] = np.abs(found[:, :, 2:]).max(axis=-1)
    # A linear plant has no higher orders; what is left is the error of the nodes, as in the first.
    assert np.max(higher / np.abs(wanted)) < 2e-4


def test_the_linear_plant_loses_in_its_dampers_what_the_road_brings() -> None:
    """Mean power over a period, from the closed form of the motion: road in, both dampers out."""
    p, frequency = PARAMETERS.as_dict(), np.geomspace(0.5, 15.0, 30)
    w = 2j * np.pi * frequency
    accel, deflection = closed_form(p, frequency).T
    z_s = accel / w**2
    z_u = z_s + deflection
    tyre = (p["k_t"] + p["c_t"] * w) * (1.0 - z_u)
    brought = 0.5 * np.real(tyre * np.conj(w))
    lost = 0.5 * (p["c"] * np.abs(w * deflection) ** 2 + p["c_t"] * np.abs(w * (1.0 - z_u)) ** 2)
    np.testing.assert_allclose(brought, lost, rtol=1e-10)
