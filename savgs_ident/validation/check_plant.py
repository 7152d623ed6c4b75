"""Whether a plant of one's own is one: what it declares, its equations, its motions, what its recordings can tell.

    check = check_plant(load_plant("pendulum.py:Pendulum"))
    for finding in check.findings:
        print(finding.severity, finding.what, finding.remedy)

Each stage is asked only where the ones before it found no fault. The last one solves the plant's motions in dwells
about its resonances, at two amplitudes, and looks at how its readings change with every parameter: one that changes
nothing cannot be identified, and of several that change the same only a combination can.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import ClassVar

import jax
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.core.values import as_values
from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.plants.model import PlantModel
from savgs_ident.simulate.excitation import sine_excitation, typical_amplitude, typical_levels
from savgs_ident.simulate.linearisation import nominal_rest, plant_signals, slopes
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import harmonic_sensitivities
from savgs_ident.validation.plant_declaration import Finding, check_declaration
from savgs_ident.validation.plant_equations import check_equations

DWELLS = 8
"""Dwells in which motions are looked at."""
BELOW, ABOVE = 0.4, 2.5
"""Their range, relative to the lowest and the highest natural frequency."""
AMPLITUDES = (1.0, 0.5)
"""Relative to the typical one: what depends on amplitude is told apart by two."""
ORDERS = 5
"""Harmonics that are looked at."""
UNSEEN = 1e-7
"""Relative change of the readings, for a change of a parameter by its tolerance or by itself, that is none."""
ALIKE = 1e-6
"""Singular value of the columns of unit length below which what they change is the same."""
TAKES_PART = 0.05
"""Least share of a parameter in a combination that changes nothing."""


@dataclass(frozen=True)
class PlantCheck(Result):
    """What a check of a plant found.

    Attributes:
        model: the plant with its numbers.
        findings: what was found, in the order in which it was looked for.
        natural_frequencies: of the plant near its nominal rest [Hz], growing; those that it has without damping are
            not asked for. Empty where it does not rest.
        frequencies: at which motions were looked at [Hz]; empty where it did not come to that.
    """

    presenter: ClassVar[str] = "PLANT_CHECK"

    model: PlantModel
    findings: tuple[Finding, ...]
    natural_frequencies: tuple[float, ...]
    frequencies: tuple[float, ...]

    @property
    def trusted(self) -> bool:
        """Whether no fault was found."""
        return all(each.severity != "fault" for each in self.findings)


def check_plant(model: PlantModel, progress: Progress = no_progress) -> PlantCheck:
    """Check a plant of one's own, with the numbers that ``model`` has.

    ``progress`` is called with a sentence on what is being done. Look at ``trusted`` of the result.
    """
    use_persistent_cache()
    progress("reading what it declares")
    findings = [*check_declaration(model)]
    natural: tuple[float, ...] = ()
    frequencies: tuple[float, ...] = ()
    if _go_on(findings):
        progress("evaluating its equations")
        findings += check_equations(model)
    if _go_on(findings):
        progress("looking for its rest")
        natural, found = _natural_frequencies(model)
        findings += found
        frequencies = _about(model, natural, DWELLS)
        progress(f"solving motions at {len(frequencies)} frequencies")
        findings += _motions(model, np.array(frequencies))
    origin = model.origin()
    return PlantCheck(model, tuple(findings), natural, frequencies, origin=origin)


def _go_on(findings: list[Finding]) -> bool:
    return all(each.severity != "fault" for each in findings)


def _natural_frequencies(model: PlantModel) -> tuple[tuple[float, ...], list[Finding]]:
    """Natural frequencies [Hz] near the nominal rest, and what is wrong with that."""
    plant, p = model.build(), as_values(model.table.as_dict())
    at = nominal_rest(plant, p)
    if not at.root.status().ok:
        what = "no state of rest was found with the inputs at rest"
        return (), [Finding("warning", what, "a plant that rests nowhere is neither linearised nor exported")]
    found = jax.tree.map(np.asarray, slopes(plant, p, at, plant_signals(plant).read))
    n = len(plant.coordinates)
    rates = np.linalg.solve(-found.residual_y, found.residual_x)
    system = np.zeros((rates.shape[1], rates.shape[1]))
    system[:n, n : 2 * n], system[n:] = np.eye(n), rates
    roots = np.linalg.eigvals(system)
    hertz = np.sort(np.abs(roots[roots.imag > 0.0])) / (2.0 * np.pi)
    faults = []
    if np.any(roots.real > 1e-6 * np.max(np.abs(roots))):
        faults = [
            Finding(
                "warning",
                "the plant is unstable about its rest: without an input it leaves it",
                "look at the signs of its forces, if that is not what it is to do",
            )
        ]
    return tuple(float(each) for each in hertz), faults


def frequencies_about(model: PlantModel, count: int) -> tuple[float, ...]:
    """So many frequencies [Hz] about the natural ones of a plant."""
    return _about(model, _natural_frequencies(model)[0], count)


def _about(model: PlantModel, natural: tuple[float, ...], count: int) -> tuple[float, ...]:
    """Frequencies about the natural ones [Hz], or about that of the typical sizes where there are none."""
    first = model.plant.coordinates[0]
    typical = first.rate_size / first.size / (2.0 * np.pi)
    low, high = (min(natural), max(natural)) if natural else (typical, typical)
    return tuple(float(each) for each in np.geomspace(BELOW * low, ABOVE * high, count))


def _motions(model: PlantModel, frequency: NDArray[np.float64]) -> Iterator[Finding]:
    plant, table, p = model.build(), model.table, as_values(model.table.as_dict())
    names = tuple(each.name for each in table.entries)
    scales = np.array([each.tolerance or abs(each.value) or 1.0 for each in table.entries])
    typical = typical_amplitude(plant, table)
    columns, lost = [], []
    for excitation in _excitations(plant, table, frequency, typical):
        solution = simulate_periodic(plant, p, excitation)
        ok = np.array([each.ok for each in solution.status()])
        lost += [f"{f:.3g} Hz" for f in frequency[~ok]]
        if not np.any(ok):
            continue
        response = np.asarray(harmonics(plant, p, solution, ORDERS))[ok, :, 1:]
        slope = np.asarray(harmonic_sensitivities(plant, p, solution, names, ORDERS))[:, ok, :, 1:]
        size = np.sqrt(np.mean(np.sum(np.abs(response) ** 2, axis=2), axis=0))[:, None]
        scaled = slope * scales[:, None, None, None] / np.where(size > 0.0, size, 1.0)
        columns.append(np.reshape(scaled, (len(names), -1)))
    if lost:
        yield Finding(
            "warning",
            f"no periodic motion was found at {', '.join(dict.fromkeys(lost))}, with the first input of "
            f"{typical:.3g} {plant.inputs[0].unit} and half of that",
            "mend `moves` and typical sizes if such a motion exists; a plant without a restoring force has none",
        )
    if columns:
        rows = np.concatenate(columns, axis=1)
        yield from _identifiability(model, np.concatenate([rows.real, rows.imag], axis=1))


def _excitations(
    plant: AbstractPlant, table: ParameterTable, frequency: NDArray[np.float64], typical: float
) -> Iterator[Excitation]:
    """Sines of the first input at its amplitudes, other inputs at rest; and each of these at levels as high.

    A current, say, without which a coil does nothing.
    """
    driven, levels = plant.inputs[0].name, typical_levels(plant, table)
    for share in AMPLITUDES:
        for held in ({}, *({name: share * level} for name, level in levels.items())):
            yield sine_excitation(plant, table, frequency, {driven: share * typical}, held)


def _identifiability(model: PlantModel, rows: NDArray[np.float64]) -> Iterator[Finding]:
    """Parameters that change nothing, and combinations of them; ``rows`` (N, R) are relative changes."""
    entries = model.table.entries
    lengths = np.linalg.norm(rows, axis=1)
    searched = np.array([each.tolerance > 0.0 or _open(each.lower, each.upper) for each in entries])
    in_use = lengths > UNSEEN * max(1.0, float(np.max(lengths)))
    # A contact holds nothing before there is a friction in it.
    waiting = {name for port in model.plant.ports for name in port.contact or ()}
    for each, seen in zip(entries, in_use, strict=True):
        if each.name in waiting:
            continue
        if not seen and each.tolerance == 0.0 and _open(each.lower, each.upper):
            yield Finding(
                "warning",
                f"parameter '{each.name}' moves nothing that a channel shows",
                "it cannot be identified: give it a tolerance, no bounds, or a channel that shows it",
            )
        elif not seen:
            yield Finding("note", f"parameter '{each.name}' moves nothing that a channel shows")
    places = np.flatnonzero(searched & in_use)
    if places.size < 2:
        return
    unit = rows[places] / lengths[places, None]
    vectors, values, _ = np.linalg.svd(unit, full_matrices=False)
    unseen = vectors[:, values <= ALIKE * values[0]]
    if not unseen.shape[1]:
        return
    known = np.array([entries[place].tolerance > 0.0 for place in places])
    # Of what no test sees, the combinations in the order of how much of them is known beforehand.
    _, pinned, turn = np.linalg.svd(np.where(known[:, None], unseen, 0.0))
    for vector, share in zip(
        (unseen @ turn.T).T, np.pad(pinned, (0, turn.shape[0] - pinned.size)), strict=True
    ):
        part = [entries[places[k]].name for k in np.flatnonzero(np.abs(vector) > TAKES_PART)]
        what = "no harmonic test can tell " + " and ".join(f"'{name}'" for name in part) + " apart"
        if share > TAKES_PART:
            yield Finding("note", f"{what}: what is known of one beforehand decides the others")
        else:
            yield Finding("warning", what, "give one of them a tolerance, or measure another channel")


def _open(lower: float, upper: float) -> bool:
    return isfinite(lower) and isfinite(upper)
