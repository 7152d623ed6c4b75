"""What a diagnosis says in words."""

from savgs_ident.diagnose.engine.climb import Mode
from savgs_ident.diagnose.judgement import Case, Judged
from savgs_ident.diagnose.result import Shrink, Verdict
from savgs_ident.diagnose.verdict import LOCAL, MATERIAL, SURE, heaviest, odds_of
from savgs_ident.effects.registry import CATALOGUE

IMPERFECT = 0.005
"""Share of the excess misfit left from which on named effects are said not to explain all."""


def verdict_of(judged: Judged, rivals: tuple[str, ...], gap: Shrink) -> Verdict:
    """The verdict with its sentence."""
    kind, chosen, place = judged.kind, judged.chosen, judged.place
    if kind == "none":
        sentence = (
            f"Nothing is missing that these data show: recalibrated, the model misses by "
            f"{_percent(gap.recalibrated)} of the response, of which the noise is {_percent(gap.floor)}."
        )
        return Verdict(kind, (), (), (), sentence + _doubted(odds_of(judged.weighed)))
    if kind == "unknown":
        sentence = (
            f"Something is missing that no effect of the catalogue explains: a law learned at the port "
            f"'{place.name}' accounts for {100.0 * place.share:.0f} % of the squared gap in tests left out, which "
            f"shrinks from {_percent(gap.recalibrated)} recalibrated to {_percent(gap.after)} of the response; "
            f"the noise is {_percent(gap.floor)}."
        )
        sentence += _nearest(judged)
        if judged.beside:
            sentence += (
                f" This campaign cannot tell the port {judged.seat} from {' or '.join(judged.beside)}."
            )
        return Verdict(kind, (), (judged.seat,), (), sentence, judged.beside)
    one = len(chosen.effects) == 1
    ports = tuple(dict.fromkeys(CATALOGUE[name].port.value for name in chosen.effects))
    names = " and ".join(chosen.effects)
    sentence = (
        f"{names} at the port{'' if len(ports) == 1 else 's'} {' and '.join(ports)} {'is' if one else 'are'} missing "
        f"in the model: with {'it' if one else 'them'} the gap shrinks from {_percent(gap.recalibrated)} "
        f"recalibrated ({_percent(gap.before)} as given) to {_percent(gap.after)} of the response; the noise is "
        f"{_percent(gap.floor)}."
    )
    if judged.another_law:
        sentence += (
            f" It acts by another law than the catalogue's, which leaves {_left(judged.left)} of the misfit beyond "
            f"the noise; what explains the rest sits at the port '{ports[0]}', too."
        )
    if rivals:
        which = "it" if one else "one of them"
        sentence += f" This campaign cannot tell {which} from {' or '.join(rivals)}."
    return Verdict(kind, chosen.effects, ports, rivals, sentence, another_law=judged.another_law)


def _doubted(odds: float) -> str:
    """What speaks for something missing where nothing is named."""
    if odds <= 0.0:
        return ""
    if odds < SURE:
        return (
            f" Evidence of {odds:.1f} nat speaks for something missing: less than the {SURE:.0f} asked for."
        )
    return (
        f" What would explain more changes the response by less than {_percent(MATERIAL)}, and by less than "
        f"{_percent(LOCAL)} in any test: too little to matter."
    )


def _nearest(judged: Judged) -> str:
    """How far the catalogue comes to something unknown."""
    if judged.unknown.reason == "strain" and judged.weighed[0].name == "unknown":
        strain, effects = judged.strained.strain, " and ".join(judged.strained.beside)
        short = f"With {effects} the" if effects else "The"
        return (
            f" {short} model would need {strain.parameter} {abs(strain.tolerances):.1f} tolerances "
            f"{'above' if strain.tolerances > 0.0 else 'below'} its sheet, which shows at the port '{judged.seat}'."
        )
    effects = " and ".join(heaviest(judged.findings).terms)
    if not effects:
        return ""
    return f" The nearest in the catalogue, {effects}, leaves {_left(judged.left)} of the misfit beyond the noise."


def _left(share: float) -> str:
    return "all" if share >= 0.995 else f"{100.0 * share:.2g} %"


def warnings_of(case: Case, after: Mode, judged: Judged, gap: Shrink) -> tuple[str, ...]:
    """What a reader must know."""
    base, left, kind = case.base, judged.left, judged.kind
    found = [
        f"The fit of {' + '.join(terms)} found no motion of the rig: it is not judged."
        for terms in judged.findings.lost
    ]
    if not judged.settled:
        found.append(
            "The named effects could not be found again on twice the nodes: what finitely many cost is still in the "
            "parameters."
        )
    for mode, name in ((base, "the recalibrated baseline"), (after, "the model with the named effects")):
        if not mode.status.ok:
            found.append(f"The search for {name} did not end well: {mode.status.advice}.")
    if kind == "none" and gap.recalibrated**2 - gap.floor**2 > MATERIAL**2:
        found.append(
            f"The recalibrated model misses by {_percent(gap.recalibrated)} of the response where the noise is "
            f"{_percent(gap.floor)}, by errors that follow no law at any port: look at the tests that miss most."
        )
    if kind in ("effect", "several") and left > IMPERFECT:
        found.append(
            f"The named effects leave {100.0 * left:.1f} % of the baseline's excess misfit: their laws are not quite "
            "those of the rig, or something small is missing besides. The intervals of their parameters are those of "
            "the noise alone."
        )
    return tuple(dict.fromkeys(found))


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"
