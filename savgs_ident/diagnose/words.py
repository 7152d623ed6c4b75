"""What a diagnosis says in words."""

from savgs_ident.diagnose.engine.attribution import Attribution
from savgs_ident.diagnose.engine.climb import Mode
from savgs_ident.diagnose.result import Kind, Shrink, Verdict
from savgs_ident.diagnose.verdict import Weighed
from savgs_ident.effects.registry import CATALOGUE

IMPERFECT = 0.005
"""Share of the excess misfit left from which on named effects are said not to explain all."""


def verdict_of(
    kind: Kind, chosen: Weighed, place: Attribution, rivals: tuple[str, ...], gap: Shrink
) -> Verdict:
    """The verdict with its sentence."""
    told = rivals if kind == "effect" else ()
    if kind == "none":
        sentence = (
            f"Nothing is missing that these data show: recalibrated, the model misses by "
            f"{_percent(gap.recalibrated)} of the response, of which the noise is {_percent(gap.floor)}."
        )
        return Verdict(kind, (), (), (), sentence)
    if kind == "unknown":
        sentence = (
            f"Something is missing that no effect of the catalogue explains: a law learned at the port "
            f"'{place.name}' accounts for {100.0 * place.share:.0f} % of the squared gap in tests left out, which "
            f"shrinks from {_percent(gap.recalibrated)} recalibrated to {_percent(gap.after)} of the response; "
            f"the noise is {_percent(gap.floor)}."
        )
        return Verdict(kind, (), (place.name,), (), sentence)
    one = len(chosen.effects) == 1
    ports = tuple(dict.fromkeys(CATALOGUE[name].port.value for name in chosen.effects))
    names = " and ".join(chosen.effects)
    sentence = (
        f"{names} at the port{'' if len(ports) == 1 else 's'} {' and '.join(ports)} {'is' if one else 'are'} missing "
        f"in the model: with {'it' if one else 'them'} the gap shrinks from {_percent(gap.recalibrated)} "
        f"recalibrated ({_percent(gap.before)} as given) to {_percent(gap.after)} of the response; the noise is "
        f"{_percent(gap.floor)}."
    )
    if told:
        sentence += f" This campaign cannot tell it from {' or '.join(told)}."
    return Verdict(kind, chosen.effects, ports, told, sentence)


def warnings_of(base: Mode, after: Mode, left: float, kind: Kind) -> tuple[str, ...]:
    """What a reader must know."""
    found = []
    for mode, name in ((base, "the recalibrated baseline"), (after, "the model with the named effects")):
        if not mode.status.ok:
            found.append(f"The search for {name} did not end well: {mode.status.advice}.")
    if kind in ("effect", "several") and left > IMPERFECT:
        found.append(
            f"The named effects leave {100.0 * left:.1f} % of the baseline's excess misfit: their laws are not quite "
            "those of the rig, or something small is missing besides."
        )
    return tuple(dict.fromkeys(found))


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"
