"""The report on the linear models of a rig: one page."""

from savgs_ident.control.linear_study import SMALL, CamMotions, EquivalentStudy, LinearStudy, SmallMotions
from savgs_ident.core.presentation import Origin
from savgs_ident.report.control.linear_figures import alpha_figure, described_figure, responses_figure
from savgs_ident.report.control.linear_text import (
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
from savgs_ident.report.text import DASH, decimal, percentage, signed


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
