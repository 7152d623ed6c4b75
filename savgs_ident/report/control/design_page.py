"""The report on an H-infinity design: one page."""

import numpy as np

from savgs_ident.control.design import Design
from savgs_ident.control.synthesis import Margins
from savgs_ident.core.presentation import Origin
from savgs_ident.report.control.design_figures import (
    gamma_figure,
    regularisation_figure,
    ride_figure,
    ride_responses,
    robustness_figure,
    sensitivity_figure,
)
from savgs_ident.report.control.design_text import (
    WEIGHT_WORDS,
    alarm,
    gain_margin_words,
    headline,
    is_reduced,
    least_gain,
    peak_in_use,
    reduced_words,
)
from savgs_ident.report.html import Fact, Section, SectionPage, Table, embed, section_page
from savgs_ident.report.text import DASH, decimal, percentage, unit_text

RESONANCE = 2.0
"""Frequency [Hz] at which the reductions are given as numbers, that of the paper."""


def design_html(design: Design, origin: Origin) -> str:
    """The page: one file, no network, nothing executed; the same design gives the same bytes."""
    sections = (_gamma, _loop, _ride, _robustness, _regularisation, _weights)
    return section_page(
        SectionPage(
            kind=f"H-infinity controller for {origin.rig}",
            title=f"Controller for {origin.rig}",
            sentence=headline(design),
            intro=(
                "Made for the linear equivalent model with the drive as a lag of the first order; checked by sweeps"
                " over frequency, when sampled, and on other rigs. This report does not contain"
                " its effect on the nonlinear rig with friction."
            ),
            alarm=alarm(design),
            facts=_facts(design),
            sections=tuple(make(design) for make in sections),
            settings={
                "Rig file": origin.model,
                "Effects": origin.with_effects,
                "Rigs it was tried on": design.rigs.source,
                "Actuator": f"first order, {decimal(design.bandwidth, 1)} Hz",
                "Controller": f"order {design.controller.nstates}, sampled at {design.digital.rate:g} Hz",
            },
            command=origin.command_line,
            versions=origin.versions,
        )
    )


def _facts(design: Design) -> tuple[Fact, ...]:
    synthesis, found = design.synthesis, design.robustness
    margins, sampled = design.margins, design.digital_margins
    stable = sum(each.stable for each in found.margins)
    least = min((each.phase_deg for each in found.margins if each.stable), default=float("nan"))
    return (
        Fact("Gamma", decimal(synthesis.gamma, 3), f"the least is {decimal(synthesis.gamma_least, 3)}"),
        _peak(design),
        Fact(
            "Phase margin",
            f"{decimal(margins.phase_deg, 1)}°" if margins.stable else DASH,
            f"sampled {decimal(sampled.phase_deg, 1)}°" if sampled.stable else "not stable when sampled",
            bad=not (margins.stable and sampled.stable),
        ),
        Fact("Gain margin", decimal(margins.gain_up, 2) if margins.stable else DASH, "times the gain"),
        Fact(
            "Stable rigs",
            f"{stable} of {len(found.margins)}",
            f"least phase margin {decimal(least, 1)}°",
            bad=not found.stable,
        ),
    )


def _peak(design: Design) -> Fact:
    """The peak of the controller that is used, which gamma does not bound once its order was reduced."""
    synthesis = design.synthesis
    if is_reduced(design):
        peak = peak_in_use(design)
        full = f"{decimal(synthesis.peak, 3)} of {synthesis.controller.nstates}"
        words = f"of order {design.controller.nstates}; {full}"
        return Fact("Peak of the closed loop", decimal(peak, 3), words, bad=peak > synthesis.gamma)
    words = f"at {decimal(synthesis.peak_frequency, 2)} Hz, by a sweep"
    return Fact("Peak of the closed loop", decimal(synthesis.peak, 3), words, bad=not synthesis.holds)


def _gamma(design: Design) -> Section:
    synthesis = design.synthesis
    cost = reduced_words(design)
    return Section(
        "gamma",
        "Guaranteed bound gamma",
        note=(
            "Under disturbances of their assumed size no weighted signal grows beyond gamma; at 1 every signal is"
            f" just within its bound. {cost}"
        ).strip(),
        picture=embed(
            gamma_figure(design),
            f"Singular values of the closed loop over frequency; the largest peaks at {decimal(synthesis.peak, 3)},"
            f" gamma is {decimal(synthesis.gamma, 3)}.",
        ),
        caption=(
            "Singular values of the closed loop from the disturbances to the weighted signals, by a sweep that knows"
            " nothing of the synthesis; on the right the largest of them near gamma."
        ),
        wide=True,
    )


def _loop(design: Design) -> Section:
    rows = tuple(
        _margin_row(name, each)
        for name, each in (("continuous", design.margins), ("sampled", design.digital_margins))
    )
    return Section(
        "margins",
        "Margins",
        note="The loop is broken where the controller's command leaves for the drive.",
        picture=embed(
            sensitivity_figure(design),
            f"Magnitude of the sensitivity over frequency, with a peak of {decimal(design.margins.sensitivity, 2)}.",
        ),
        caption="The sensitivity: one over the distance of the open loop from the point where it becomes unstable.",
        wide=True,
        table=Table(
            "Stability margins",
            ("Loop", "Stable", "More gain", "Less gain", "Phase", "Delay", "Peak of sensitivity"),
            rows,
            (2, 3, 4, 5, 6),
        ),
    )


def _margin_row(name: str, margins: Margins) -> tuple[str, ...]:
    if not margins.stable:
        return (name, "no", *[DASH] * 5)
    delay = decimal(1e3 * margins.delay, 1)
    return (
        name,
        "yes",
        gain_margin_words(margins.gain_up),
        gain_margin_words(least_gain(margins)),
        f"{decimal(margins.phase_deg, 1)}°",
        delay if delay == DASH else f"{delay} ms",
        decimal(margins.sensitivity, 2),
    )


def _ride(design: Design) -> Section:
    passive, active = ride_responses(design, np.array([RESONANCE]))
    accel, deflection = (1.0 - np.abs(active) / np.abs(passive))[0]
    return Section(
        "ride",
        "From the road",
        note=(
            f"At {RESONANCE:g} Hz the acceleration of the sprung mass is cut by {percentage(accel)} and the"
            f" deflection of the suspension by {percentage(deflection)}, in the linear model: without friction, and"
            " without the limits of the drive."
        ),
        picture=embed(
            ride_figure(design),
            "Magnitude of acceleration and deflection per metre of road, with the link held and with the loop closed;"
            f" at {RESONANCE:g} Hz they are cut by {percentage(accel)} and {percentage(deflection)}.",
        ),
        caption="Where the blue line is above the orange one the controller pays for what it gains elsewhere.",
        wide=True,
    )


def _robustness(design: Design) -> Section:
    found = design.robustness
    stable = sum(each.stable for each in found.margins)
    return Section(
        "robustness",
        "On other rigs",
        note=f"The same controller on {design.rigs.source}: stable on {stable} of {len(found.margins)}.",
        picture=embed(
            robustness_figure(design),
            f"Peak of the closed loop and phase margin on {len(found.margins)} rigs; {stable} are stable, the worst"
            f" peak is {decimal(max(found.peaks), 3)}.",
        ),
        caption="Rigs in the same order on both sides. A peak above gamma means less performance, not instability.",
        wide=True,
    )


def _regularisation(design: Design) -> Section:
    rows = tuple(
        (
            WEIGHT_WORDS[each.weight],
            f"{each.factor:g}",
            decimal(each.gamma_least, 4),
            decimal(each.phase_deg, 1),
            decimal(each.fastest_pole, 0),
        )
        for each in design.regularisation
    )
    return Section(
        "regularisation",
        "What the regularising weights do",
        note=(
            "Noise on every measurement and a drift of the actuator keep the problem regular. What each of them"
            " costs in gamma, and what it does to the phase margin and to the speed of the controller, is shown here."
        ),
        picture=embed(
            regularisation_figure(design),
            "Least gamma, phase margin and fastest pole of the controller over factors from 0.1 to 10 on each of the"
            " four regularising weights.",
        ),
        caption="One weight is changed at a time, and the controller made anew.",
        wide=True,
        table=Table(
            "Regularising weights in numbers",
            ("Weight", "Times", "Least gamma", "Phase margin [°]", "Fastest pole [rad/s]"),
            rows,
            (1, 2, 3, 4),
        ),
    )


def _weights(design: Design) -> Section:
    rows = tuple(
        (each.name, f"{each.value:g}", unit_text(each.unit), each.about) for each in design.weights.entries
    )
    return Section(
        "weights",
        "Weights",
        table=Table("Weights of the design", ("Weight", "Value", "Unit", "Description"), rows, (1,)),
    )
