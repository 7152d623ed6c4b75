"""Families of laws: functions of what a place sees, any sum of which is a law, and the few that make simple ones.

The functions of a family are smooth, some sharp about zero velocity, where friction turns round. Most of what is
missing in a model is simple: one friction, one compliance, one delay. A sum of a dozen functions can do the same, but
so can that of the place beside it; so every family also has its simple laws, of one function or a few.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.attribution import Law
from savgs_ident.diagnose.rig.nodes import Nodes, Signal
from savgs_ident.effects.learned.forces import OF_THE_LOAD, OF_THE_MOTION, functions
from savgs_ident.simulate.periodic import PeriodicSolution

STRETCHES = (1e-4, 1e-3)
"""How far a contact gives before it slides [m]."""

RESONANCES = (3.0, 4.0, 5.4, 7.3, 9.8, 13.0, 18.0, 24.0, 33.0, 50.0)
"""Natural frequencies [Hz] of what the frame may do."""

WAVES = (4, 5, 6, 7, 8, 9)
"""Orders of what may be wavy on a cam, beyond those of its shape."""

INSTANTS = 256
"""Instants of a period at which a law of a sensor's reading is evaluated."""

SIMPLE = 0.1
"""Probability of a family's simple laws, to that of any other: most that is so simple is in the catalogue."""

_FRICTION, _DAMPING, _STIFFNESS = (OF_THE_MOTION.index(words) for words in ("tanh(v/0.01)", "v", "x"))
_LOADED_FRICTION = len(OF_THE_MOTION) + OF_THE_LOAD.index("n tanh(v/0.01)")

GAIN_AND_RATE = (0, 1)
"""Places of the plain filters among those of :func:`filters_of`: a gain, and the rate, which is a small delay."""


class Family(NamedTuple):
    """Functions of what a place sees at P nodes.

    Attributes:
        functions: q of them [1, or the unit of what they are made of], (P,) each.
        plain: places among them of those that make a simple law together.
    """

    functions: list[Signal]
    plain: tuple[int, ...] = ()


def laws_of(columns: NDArray[np.float64], plain: tuple[int, ...] = ()) -> tuple[Law, ...]:
    """The laws of a family: any sum of its functions, each of them alone, and the plain ones together.

    The functions change the rows by ``columns`` [unit of the row], (m, q); ``plain`` are places among the q.
    """
    alone = [columns[:, [place]] for place in range(columns.shape[1])]
    shares = [SIMPLE / len(alone)] * len(alone)
    if plain:
        shares = [*(share / 2.0 for share in shares), SIMPLE / 2.0]
        alone.append(columns[:, list(plain)])
    return (Law(columns), *(Law(few, share) for few, share in zip(alone, shares, strict=True)))


def of_a_force(displacement: Signal, velocity: Signal, load: Signal, solution: PeriodicSolution) -> Family:
    """Forces as functions of what a port sees, and those of contacts that give.

    Displacement [m], velocity [m/s] and load [N] are those at the nodes of ``solution``, (P,) each.
    """
    found = _motion_laws(displacement, velocity, load)
    plain = [_FRICTION, _DAMPING, _STIFFNESS, *([_LOADED_FRICTION] if np.any(load) else [])]
    held = [_stop(displacement, width, solution) for width in STRETCHES]
    return Family([*found, *held], (*plain, *range(len(found), len(found) + len(held))))


def of_what_gives(beyond: Signal, rate: Signal) -> Family:
    """Ways by which something gives under a load, as functions of this and of its rate.

    ``beyond`` is the load less that at rest [N or N m], ``rate`` its rate [N/s or N m/s], (P,) each.
    """
    return Family(_motion_laws(beyond, rate, np.zeros_like(beyond)), (_STIFFNESS, _DAMPING))


def of_the_cam(nodes: Nodes, solution: PeriodicSolution) -> Family:
    """What a cam of another shape or lift would do, and one that turns a moment earlier or later than is told."""
    angle, speed = _cam_angle(nodes, solution), nodes.omega / np.max(nodes.omega)
    shapes = [wave(order * angle) for order in (1, 2, 3) for wave in (np.cos, np.sin)]
    return Family([*shapes, speed * np.cos(angle), speed * np.sin(angle)], (0, 1))


def of_a_wavy_cam(nodes: Nodes, solution: PeriodicSolution) -> Family:
    """Waves [1] on a cam that are shorter than those of a wrong shape."""
    angle = _cam_angle(nodes, solution)
    return Family([wave(order * angle) for order in WAVES for wave in (np.cos, np.sin)])


def _cam_angle(nodes: Nodes, solution: PeriodicSolution) -> Signal:
    return np.asarray(nodes.phase + np.angle(np.asarray(solution.excitation.road))[:, 1][nodes.dwell])


def of_the_frame(load: Signal, nodes: Nodes) -> Family:
    """A frame that gives under a load [N] at the nodes, (P,), and what slightly damped modes would make of it."""
    modes = [_resonance(load, natural, nodes) for natural in RESONANCES]
    return Family([load, *modes])


def filters_of(omega: Signal) -> list[NDArray[np.complex128]]:
    """Linear filters of a reading [1]: gain, rate, rate of the rate, lags.

    Filters and angular frequencies ``omega`` [rad/s] are (dwells, orders) each.
    """
    rate = 1j * omega / 20.0
    lags = [corner / (corner + 1j * omega) for corner in (20.0, 60.0, 180.0)]
    return [np.asarray(each, np.complex128) for each in (np.ones_like(rate), rate, rate**2, *lags)]


def of_a_reading(reading: NDArray[np.complex128], omega: Signal) -> list[NDArray[np.complex128]]:
    """Harmonics [1] of functions of a reading and its rate.

    They, the harmonics of the ``reading`` [its unit] and the angular frequencies ``omega`` [rad/s] are
    (dwells, orders) each.
    """
    orders = reading.shape[1]
    turn = np.exp(2j * np.pi * np.outer(np.arange(orders), np.arange(INSTANTS)) / INSTANTS)
    along, rate = (np.real(each[:, 1:] @ turn[1:]) for each in (reading, 1j * omega * reading))
    laws = _motion_laws(along.ravel(), rate.ravel(), np.zeros(along.size))
    return [np.fft.rfft(each.reshape(along.shape))[:, :orders] * 2.0 / INSTANTS for each in laws]


def _motion_laws(displacement: Signal, velocity: Signal, load: Signal) -> list[Signal]:
    """Functions of what a port sees, each of about unit size."""
    x = displacement - displacement.mean()
    x = x / max(float(np.abs(x).max()), np.finfo(float).tiny)
    v = velocity / max(float(np.abs(velocity).max()), np.finfo(float).tiny)
    loaded = bool(np.any(load))
    n = load / np.abs(load).max() if loaded else load
    found = [np.asarray(each) for each in functions(jnp.asarray(x), jnp.asarray(v), jnp.asarray(n))]
    return found if loaded else found[: -len(OF_THE_LOAD)]


def _stop(displacement: Signal, width: float, solution: PeriodicSolution) -> Signal:
    """What a contact of unit grip carries that gives by ``width`` [m] before it slides (Prandtl's element)."""
    carried = np.zeros_like(displacement)
    for first, count in zip(solution.mesh.layout.starts, solution.mesh.layout.counts, strict=True):
        along = displacement[first : first + count]
        moves = (along - np.roll(along, 1)) / width
        now = 0.0
        # The first period forgets where it began.
        for place, move in enumerate((*moves, *moves)):
            now = min(max(now + move, -1.0), 1.0)
            carried[first + place % count] = now
    return carried


def _resonance(load: Signal, natural: float, nodes: Nodes) -> Signal:
    """What an oscillator of a natural frequency [Hz] makes of a load (P,)."""
    out, grid, own = np.zeros_like(load), 2.0 * np.pi * np.arange(256) / 256, 2.0 * np.pi * natural
    for test in range(int(nodes.dwell.max()) + 1):
        rows = np.flatnonzero(nodes.dwell == test)
        spectrum = np.fft.rfft(np.interp(grid, nodes.phase[rows], load[rows], period=2.0 * np.pi))
        omega = nodes.omega[rows[0]] * np.arange(spectrum.size)
        answer = np.fft.irfft(spectrum * own**2 / (own**2 - omega**2 + 0.2j * own * omega), 256)
        out[rows] = np.interp(nodes.phase[rows], grid, answer, period=2.0 * np.pi)
    return out
