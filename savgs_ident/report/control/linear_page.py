"""The report on the linear models of a rig: one page, and its figures.

The figures show the equivalent over the link angle, small motions, and motions of the test.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from savgs_ident.control.linear_study import (
    SMALL,
    WISHBONE_DEG,
    CamMotions,
    EquivalentStudy,
    LinearStudy,
    SmallMotions,
)
from savgs_ident.control.linearisation import ELEMENTS
from savgs_ident.core.presentation import Origin
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.report.control.linear_text import (
    ELEMENT_WORDS,
    FAR,
    alarm,
    described_words,
    digits,
    headline,
    sign_of_alpha,
    slow_words,
    step_words,
)
from savgs_ident.report.html import Fact, Section, SectionPage, Table, embed, section_page
from savgs_ident.report.text import DASH, decimal, percentage, response_labels, signed
from savgs_ident.report.theme import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    PALE,
    frequency_axis,
    magnitude_axis,
    new_figure,
    printable,
    styled,
)


def linear_html(study: LinearStudy, origin: Origin) -> str:
    """The page: one file, no network, nothing executed; the same study gives the same bytes."""
    described = () if study.at_test is None else (_described(study, study.at_test),)
    return section_page(
        SectionPage(
            kind=f"Linear models of {origin.rig}",
            title=f"Linear models of {origin.rig}",
            sentence=headline(study),
            intro=(
                "Derivatives of the nonlinear model, no second set of equations; compared with the nonlinear model at"
                " small motions and at the size of the test."
            ),
            alarm=alarm(study),
            facts=_facts(study),
            sections=(_equivalent(study.equivalents), _small(study.small), *described),
            settings={"Rig file": origin.model, "Effects": origin.with_effects},
            command=origin.command_line,
            versions=origin.versions,
        )
    )


def _facts(study: LinearStudy) -> tuple[Fact, ...]:
    nominal, small = study.equivalents.nominal, study.small
    first, *_, last = small.models
    test = study.at_test
    return (
        Fact("Stiffness", digits(float(nominal.k_eq) / 1e3), "kN/m at the wheel, k_eq"),
        Fact("Damping", digits(float(nominal.c_eq) / 1e3), "kN s/m at the wheel, c_eq"),
        Fact("Turn of the link", digits(float(nominal.alpha) * 1e3), "mm/rad at the wheel, alpha"),
        Fact(
            "Exact linearisation",
            percentage(small.error(last), 2),
            f"off at small motions; {first} {percentage(small.error(first))}",
            bad=not study.trusted,
        ),
        Fact(
            "Describing functions",
            DASH if test is None else percentage(test.error, 2),
            "no friction" if test is None else "off on the cam of the test",
            bad=test is not None and test.error >= FAR,
        ),
    )


def _equivalent(study: EquivalentStudy) -> Section:
    lowest, highest = (float(each) for each in (study.link_deg[0], study.link_deg[-1]))
    rows = tuple(
        (
            name,
            percentage(each.rms, 2),
            percentage(each.largest, 2),
            ", ".join(map(digits, each.coefficients)),
        )
        for name, each in study.approximations.items()
    )
    words = (
        f"Three curves over link angles from {lowest:g} to {highest:g} degrees: stiffness, damping and magnitude of"
        " alpha, each with the nearest constant, alpha with the nearest parabola, too."
    )
    return Section(
        "equivalent",
        "Over the link angle",
        note=(
            "The strut as a spring and a damper between the masses, and a turn of the link as a displacement alpha of"
            f" their upper end. With the deflection positive in bump alpha is {sign_of_alpha(study)}; drawn is its"
            " magnitude."
        ),
        picture=embed(alpha_figure(study), words),
        caption=(
            "The wishbone rests under the load at every link angle; the grey band is what it does when it moves."
            " What the table leaves is a share of the greatest magnitude."
        ),
        wide=True,
        table=Table(
            "How well constants and parabolas stand for them (in powers of the link angle [rad], SI)",
            ("What by what", "Rms left", "Largest", "Coefficients"),
            rows,
            (1, 2),
        ),
    )


def _small(small: SmallMotions) -> Section:
    steps = step_words(small)
    rows = tuple((name, percentage(small.error(name), 2), words) for name, words in steps.items())
    errors = "; ".join(f"{name} {percentage(small.error(name), 2)}" for name in small.models)
    return Section(
        "small",
        "Small motions",
        note=f"{slow_words(small)} Friction is left out here: at rest it holds the rig.",
        picture=embed(
            responses_figure(small),
            f"Magnitudes of both channels over road frequency, and the difference to the nonlinear rig: {errors}.",
        ),
        caption=(
            f"Responses to a cam of {SMALL * 1e6:g} µm peak to peak. Below: how far each linear model is from the"
            " nonlinear rig, relatively, phase included."
        ),
        wide=True,
        table=Table(
            "Simplifications of equation (8), undone one after the other",
            ("Linear model", "Largest difference", "What it takes into account"),
            rows,
            (1,),
        ),
    )


def _described(study: LinearStudy, test: CamMotions) -> Section:
    described = test.described
    rows = tuple(
        (
            decimal(float(frequency), 2),
            *(decimal(float(value) / 1e3, 3) for value in described.damping[d]),
            *(signed(float(value) / 1e3, 3) for value in described.stiffness[d]),
        )
        for d, frequency in enumerate(described.frequency)
    )
    headers = ("Frequency [Hz]", *(f"{part} {of}" for of in "ck" for part in ("Rail", "Damper", "Tyre")))
    return Section(
        "described",
        "Motions of the test",
        note=(
            "At the size of the test the friction of the rail and of the tyre, and the damper, are the linear"
            f" elements that their first harmonics are. {described_words(study)}"
        ),
        picture=embed(
            described_figure(test),
            f"First harmonics on the cam of the test, nonlinear and linear, within {percentage(test.error, 2)}; and"
            " damping and stiffness of rail, damper and tyre friction over road frequency.",
        ),
        caption=(
            "Force over velocity of each element where it acts: along the rail, along the strut, across the tyre."
            " Where the stiffness is positive the force lags, as a spring's does; where it is negative it leads."
        ),
        wide=True,
        table=Table(
            "Describing functions: damping c [kN s/m] and stiffness k [kN/m]",
            headers,
            rows,
            tuple(range(1, 7)),
        ),
    )


_READINGS = response_labels(RIG_LAYOUT)
"""The responses that are compared."""

_CURVE: Mapping[str, Any] = MappingProxyType({"color": BLUE, "linewidth": 1.8})
_CONSTANT: Mapping[str, Any] = MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.6})
_PARABOLA: Mapping[str, Any] = MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.4})
_NONLINEAR: Mapping[str, Any] = MappingProxyType(
    {"color": INK, "linestyle": "none", "marker": "o", "markersize": 4.5, "markerfacecolor": "white"}
)
_STEPS: tuple[Mapping[str, Any], ...] = (
    MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "linewidth": 1.5}),
    MappingProxyType({"color": INK, "linestyle": (0, (6, 1.5, 1, 1.5)), "linewidth": 1.1}),
    MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "linewidth": 1.8}),
    MappingProxyType({"color": BLUE, "linestyle": "-", "linewidth": 1.7}),
)
"""How the linear models look, from equation (8) to the exact one."""

_ELEMENT_LOOKS: tuple[Mapping[str, Any], ...] = (
    MappingProxyType({"color": BLUE, "linestyle": "-", "marker": "o"}),
    MappingProxyType({"color": ORANGE, "linestyle": (0, (5, 2)), "marker": "s"}),
    MappingProxyType({"color": GREY, "linestyle": (0, (1, 1.2)), "marker": "^"}),
)


def alpha_figure(study: EquivalentStudy) -> Figure:
    """k_eq, c_eq and the magnitude of alpha over the link angle, with what stands for them: Fig. 7 of the paper."""
    itself = sign_of_alpha(study)
    panels = (
        ("k_eq", 1e-3, "equivalent stiffness k_eq [kN/m]"),
        ("c_eq", 1e-3, "equivalent damping c_eq [kN s/m]"),
        (
            "alpha",
            1e3 if itself == "positive" else -1e3,
            f"magnitude of alpha [mm/rad]\n(alpha itself is {itself})",
        ),
    )
    with styled():
        figure = new_figure(10.5, 4.2)
        grid = figure.subplots(1, len(panels))
        for axes, (name, scale, label) in zip(grid, panels, strict=True):
            _draw_equivalent(axes, study, name, scale)
            axes.set_ylabel(label)
        handles, labels = grid[-1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return figure


def _draw_equivalent(axes: Axes, study: EquivalentStudy, name: str, scale: float) -> None:
    """One part of the equivalent, times ``scale``, over the link angle."""
    link, exact = study.link_deg, scale * getattr(study.resting, name)
    surface = scale * getattr(study.surface, name)
    ends = f"wishbone within ± {WISHBONE_DEG[-1]:g} deg"
    axes.fill_between(
        link, np.nanmin(surface, axis=1), np.nanmax(surface, axis=1), color=PALE, linewidth=0.0, label=ends
    )
    axes.plot(link, exact, label="wishbone at rest", **_CURVE)
    constant, parabola = f"{name} by a constant", f"{name} by a parabola"
    for key, label, look in (
        (constant, "nearest constant", _CONSTANT),
        (parabola, "nearest parabola", _PARABOLA),
    ):
        if key in study.approximations:
            axes.plot(link, scale * study.approximations[key](np.radians(link)), label=label, **look)
    axes.set_xticks(np.arange(0.0, 181.0, 30.0))
    axes.set_xlim(0.0, 180.0)
    axes.set_ylim(bottom=0.0 if name == "alpha" else None)
    axes.set_xlabel("link angle [deg]")


def responses_figure(small: SmallMotions) -> Figure:
    """Magnitudes of the linear models and the nonlinear rig at small motions, and how far they are apart."""
    with styled():
        figure = new_figure(10.5, 7.4)
        grid = figure.subplots(2, len(_READINGS), squeeze=False, height_ratios=(1.2, 1.0))
        for c, (column, shown) in enumerate(zip(grid.T, _READINGS.values(), strict=True)):
            column[0].set_title(shown.title)
            column[0].set_ylabel(f"magnitude [{shown.per_input} of road]")
            column[1].set_ylabel("difference to the nonlinear rig [%]")
            nonlinear = small.nonlinear[:, c]
            column[0].plot(small.frequency, np.abs(nonlinear), label="nonlinear rig", **_NONLINEAR)
            for (name, response), look in zip(small.models.items(), _STEPS, strict=True):
                away = 100.0 * np.abs(response[:, c] / nonlinear - 1.0)
                column[0].plot(small.frequency, np.abs(response[:, c]), label=printable(name), **look)
                column[1].plot(small.frequency, away, **look)
            for axes in column:
                magnitude_axis(axes)
                frequency_axis(axes, small.frequency[0], small.frequency[-1], labelled=axes is column[-1])
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return figure


def described_figure(test: CamMotions) -> Figure:
    """First harmonics on the cam of the test, nonlinear and with describing functions, and what the elements are."""
    described = test.described
    ends = float(described.frequency[0]), float(described.frequency[-1])
    with styled():
        figure = new_figure(10.5, 7.4)
        upper, lower = figure.subplots(2, len(_READINGS), squeeze=False)
        for c, (axes, shown) in enumerate(zip(upper, _READINGS.values(), strict=True)):
            axes.set_title(shown.title)
            axes.set_ylabel(f"magnitude [{shown.per_input} of road]")
            axes.plot(
                described.frequency,
                np.abs(test.quasi_linear[:, c]),
                label="linear with describing functions",
                **_CURVE,
            )
            axes.plot(described.frequency, np.abs(test.nonlinear[:, c]), label="nonlinear rig", **_NONLINEAR)
            axes.set_ylim(bottom=0.0)
            axes.legend(loc="lower right")
        for axes, values, label in (
            (lower[0], described.damping, "equivalent damping [kN s/m]"),
            (lower[1], described.stiffness, "equivalent stiffness [kN/m]"),
        ):
            for place, (element, look) in enumerate(zip(ELEMENTS, _ELEMENT_LOOKS, strict=True)):
                words = ELEMENT_WORDS[element]
                axes.plot(described.frequency, 1e-3 * values[:, place], label=words, markersize=4.0, **look)
            axes.set_ylabel(label)
            axes.axhline(0.0, color=INK, linewidth=0.6)
            axes.legend()
        for axes in (*upper, *lower):
            frequency_axis(axes, *ends, labelled=axes in lower)
        return figure
