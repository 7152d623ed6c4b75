"""A plan of a campaign: as a JSON object, as a list of dwells, in the terminal, and drawn."""

import csv
import io
from collections.abc import Sequence
from itertools import cycle
from math import isfinite
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.console import Group, RenderableType

from savgs_ident.plants.base import Input
from savgs_ident.report.text import fixed, plain, significant, stacked, table
from savgs_ident.report.theme import INK, ORANGE, magnitude_axis, new_figure, styled
from savgs_ident.validation.plan import CampaignPlan, PlannedTest

MARKERS = "osD^vP*"
"""Of dwells, by what inputs beside the first one do."""

MANY = 999.0
"""Standard deviations beyond which their number says nothing more [1]."""


def plan_record(plan: CampaignPlan) -> dict[str, Any]:
    """The dwells, what is known with them, and what they would show of the catalogue; SI, errors relative [1]."""
    return {
        "schema": 1,
        "enough": plan.trusted,
        "target": plan.target,
        "tests": [
            {
                "test": _name(each.frequency_hz, place),
                "frequency_hz": each.frequency_hz,
                "amplitude": each.programme.amplitude,
                "levels": dict(each.programme.levels),
                "beside": dict(each.programme.beside),
                "errors": dict(zip(plan.free, each.errors, strict=True)),
            }
            for place, each in enumerate(plan.tests)
        ],
        "errors": plan.errors,
        "least_errors": dict(zip(plan.free, plan.least, strict=True)),
        "effects": [
            {
                "effect": each.name,
                "sigma": each.sigma,
                "smallest": each.smallest if isfinite(each.smallest) else None,
                "unit": each.unit,
                "alike": each.alike,
                "apart_sigma": each.apart,
            }
            for each in plan.effects
        ],
        "visible_sigma": plan.visible,
        "not_visible": plan.not_visible,
        "not_separated": plan.not_separated,
        "noise": dict(plan.noise),
        "noise_assumed": plan.assumed,
        "offered": plan.offered,
        "unsolved": plan.unsolved,
        "command": plan.origin.command_line,
    }


def plan_list(plan: CampaignPlan) -> str:
    """The dwells as CSV, by growing amplitude and frequency, with the names that they have in the record."""
    out = io.StringIO()
    driven = plan.model.plant.inputs[0]
    writer = csv.writer(out, lineterminator="\n")
    moved, held = _moved(plan), _held(plan)
    writer.writerow(
        [
            "test",
            "frequency [Hz]",
            f"amplitude of {driven.name} [{driven.unit}]",
            *(f"amplitude of {each.name}, below zero against it [{each.unit}]" for each in moved),
            *(f"{each.name} above rest [{each.unit}]" for each in held),
        ]
    )

    def order(given: tuple[int, PlannedTest]) -> tuple[float, ...]:
        _, each = given
        first, *others = _driven_by(each, moved, held)
        return (*others, first, each.frequency_hz)

    for place, each in sorted(enumerate(plan.tests), key=order):
        numbers = each.frequency_hz, *_driven_by(each, moved, held)
        writer.writerow([_name(each.frequency_hz, place), *(f"{number:.5g}" for number in numbers)])
    return out.getvalue()


def _held(plan: CampaignPlan) -> list[Input]:
    """The further inputs that any test holds at a level."""
    return [
        each
        for each in plan.model.plant.inputs
        if any(each.name in one.programme.levels for one in plan.tests)
    ]


def _moved(plan: CampaignPlan) -> list[Input]:
    """The further inputs that any test moves along."""
    return [
        each
        for each in plan.model.plant.inputs
        if any(each.name in one.programme.beside for one in plan.tests)
    ]


def _driven_by(test: PlannedTest, moved: Sequence[Input], held: Sequence[Input]) -> tuple[float, ...]:
    """Amplitudes of the first input and of those ``moved`` along, and levels of those ``held`` [their units]."""
    run = test.programme
    return (
        run.amplitude,
        *(run.beside.get(each.name, 0.0) for each in moved),
        *(run.levels.get(each.name, 0.0) for each in held),
    )


def _name(hertz: float, place: int) -> str:
    """A test's name, from which readers know that it is a dwell, and at which frequency."""
    digits = np.format_float_positional(hertz, precision=4, fractional=False, trim="-")
    return f"dwell_{digits}Hz_{place + 1}"


def plan_text(plan: CampaignPlan) -> RenderableType:
    """The dwells with the errors that they lead to, then what cannot be seen or told apart."""
    driven, moved, held = plan.model.plant.inputs[0], _moved(plan), _held(plan)
    rows = [
        (
            str(place + 1),
            fixed(each.frequency_hz, 3),
            *(significant(number) for number in _driven_by(each, moved, held)),
            *(fixed(100.0 * error, 2) for error in each.errors),
        )
        for place, each in enumerate(plan.tests)
    ]
    headers = (
        "",
        "f\n[Hz]",
        f"{driven.name}\n[{driven.unit}]",
        *(f"{stacked(one.name)}\n[{one.unit}]" for one in (*moved, *held)),
        *(f"{stacked(name)}\n[%]" for name in plan.free),
    )
    title = f"Dwells of {plan.offered}, and standard errors with each and all before it"
    noise = ", ".join(
        f"{each.name} {significant(plan.noise[each.name], 2)} {each.unit}" for each in plan.model.channels
    )
    assumed = f"; assumed: {', '.join(plan.assumed)} (give it by --noise)" if plan.assumed else ""
    lost = f" No periodic motion was found at {', '.join(plan.unsolved)}." if plan.unsolved else ""
    return Group(
        table(title, headers, rows),
        plain(f"Noise of one sample: {noise}{assumed}.{lost}"),
        plain("All to first order, by noise and tolerances alone: small errors of the model are not in it."),
        *_limits_of(plan),
        plain(""),
        *_effects_of(plan),
    )


def _limits_of(plan: CampaignPlan) -> list[RenderableType]:
    """Of which parameters more dwells would tell no more."""
    if not plan.limited:
        return []
    named = ", ".join(f"{name} ({fixed(100.0 * plan.errors[name], 2)} %)" for name in plan.limited)
    return [plain(f"More dwells tell no more of {named}: what is known to a tolerance limits them.")]


def _effects_of(plan: CampaignPlan) -> list[RenderableType]:
    """What the campaign would show of the catalogue."""
    visible = [each for each in plan.effects if each.sigma >= plan.visible]
    rows = [
        (
            each.name,
            f"{significant(each.smallest, 3)} {each.unit}",
            each.alike or "-",
            significant(each.apart, 3) if each.apart < MANY else f"> {MANY:.0f}",
        )
        for each in visible
    ]
    headers = ("effect", "seen from", "most alike", "apart\n[sd]")
    shown = [
        table(
            f"Effects that it would show: {len(visible)} of {len(plan.effects)}", headers, rows, texts=(0, 2)
        )
    ]
    if plan.not_separated:
        pairs = dict.fromkeys(tuple(sorted(pair)) for pair in plan.not_separated)
        words = "; ".join(f"{one} and {other}" for one, other in pairs)
        shown.append(plain(f"Not told apart at typical sizes: {words}."))
    if plan.not_visible:
        shown.append(plain(f"Not seen at typical sizes: {', '.join(plan.not_visible)}."))
    return shown


def plan_figure(plan: CampaignPlan) -> Figure:
    """The dwells by frequency and amplitude in their order, and the errors of the free parameters with each."""
    driven = plan.model.plant.inputs[0]
    hertz = np.array([each.frequency_hz for each in plan.tests])
    sizes = np.array([each.programme.amplitude for each in plan.tests])
    others = [", ".join(each.programme.others(plan.model)) or "alone" for each in plan.tests]
    kinds = list(dict.fromkeys(others))
    with styled():
        figure = new_figure(9.2, 3.8)
        left, right = figure.subplots(1, 2)
        for kind, marker in zip(kinds, cycle(MARKERS), strict=False):
            mine = np.array([each == kind for each in others])
            left.plot(
                hertz[mine], sizes[mine], marker, color=INK, mfc="none", markersize=5.0, label=kind, ls="none"
            )
        for place, (kind, *at) in enumerate(zip(others, hertz, sizes, strict=True)):
            above = (0, 6 + 9 * kinds.index(kind))
            left.annotate(
                str(place + 1), at, xytext=above, textcoords="offset points", ha="center", fontsize=8
            )
        if kinds != ["alone"]:
            left.legend(fontsize=8, loc="lower right")
        left.set_xlabel("frequency [Hz]")
        left.set_ylabel(f"amplitude of {driven.name} [{driven.unit}]")
        left.set_ylim(0.0, 1.25 * float(sizes.max()))
        count = np.arange(1, len(plan.tests) + 1)
        for place, name in enumerate(plan.free):
            errors = 100.0 * np.array([each.errors[place] for each in plan.tests])
            right.plot(count, errors, marker="o", markersize=3.0, label=name)
        magnitude_axis(right)
        right.axhline(100.0 * plan.target, color=ORANGE, lw=1.0, ls="--", label="asked for")
        right.set_xlabel("dwells")
        right.set_ylabel("relative standard error [%]")
        right.legend(fontsize=8)
        return figure
