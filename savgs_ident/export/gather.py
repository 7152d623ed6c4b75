"""What is known about a model, brought together before it is exported.

Rig file, posterior and diagnosis may come from different runs. What they say of each other is checked here, and told:
``said`` are sentences on where the numbers come from, ``doubts`` on why they are not to be trusted.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import EFFECTS
from savgs_ident.export.diagnosed import TOLD, Diagnosed, listed, with_diagnosis
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.model.effect import AbstractSensorFault
from savgs_ident.posterior.draws import FAR, Draws, far_from_draws, read_draws, thin_draws


@dataclass(frozen=True)
class Gathered:
    """A model on its way out, with what a reader must know about it.

    Attributes:
        model: the model.
        said: where its numbers come from, a sentence each.
        doubts: why it is not to be trusted, a sentence each; none if it is.
    """

    model: ExportedModel
    said: tuple[str, ...]
    doubts: tuple[str, ...]


def gather(
    rig: Rig,
    effects: tuple[str, ...],
    diagnosis: Mapping[str, object] = MappingProxyType({}),
    posterior: Path | None = None,
    count: int | None = None,
) -> Gathered:
    """The model of a rig with ``effects``, what a ``diagnosis`` adds to it, and ``count`` draws of its posterior.

    Sentences and doubts stand in the provenance of the model's rig, too, as ``notes``, so that they travel along.
    Raises :class:`InputError` for a diagnosis of another model or draws that cannot be used.
    """
    found = with_diagnosis(rig, effects, diagnosis) if diagnosis else Diagnosed(rig, effects, (), ())
    model = ExportedModel(found.rig, found.effects, diagnosis=diagnosis)
    doubts = [*_doubts_of_fit(rig, found), *_doubts_of_diagnosis(diagnosis)]
    if posterior is not None:
        draws = read_draws(posterior, tuple(model.table))
        doubts += _doubts_of_draws(model, draws, found.added, posterior)
        model = replace(model, samples=thin_draws(draws, count))
    said = (*_other_model(rig, effects), *found.said, *_sensors(model))
    notes = [*said, *doubts]
    if notes:
        noted = replace(model.rig, provenance={**model.rig.provenance, "notes": notes})
        model = replace(model, rig=noted)
    return Gathered(model, said, tuple(doubts))


def _other_model(rig: Rig, effects: tuple[str, ...]) -> tuple[str, ...]:
    """Whether the rig file was identified with other effects than those asked for."""
    known = rig.provenance.get("effects")
    if not isinstance(known, list | tuple) or set(map(str, known)) == set(effects):
        return ()
    return (
        f"The rig file was identified with {listed(known) or 'no friction'} and is taken with"
        f" {listed(effects) or 'no friction'}: what the model has of its numbers is of that fit.",
    )


def _sensors(model: ExportedModel) -> tuple[str, ...]:
    """What the equations leave out of the readings."""
    return tuple(
        f"{name} is an error of a sensor, not of the rig: the outputs of the equations are without it."
        for name in model.effects
        if isinstance(EFFECTS[name], AbstractSensorFault)
    )


def _doubts_of_fit(rig: Rig, found: Diagnosed) -> tuple[str, ...]:
    if rig.provenance.get("trusted", True):
        return ()
    moved = _moved_by_fit(rig)
    left = [name for name in moved if name not in found.taken]
    if moved and not left:  # The diagnosis fitted all of them anew.
        return ()
    doubt = f"The rig file's own fit is not to be trusted ({rig.provenance.get('status', 'no status')})"
    if not found.added:
        return (f"{doubt}.",)
    names = f" ({', '.join(left[:TOLD])}{', ...' if len(left) > TOLD else ''})" if left else ""
    return (f"{doubt}, and some of its numbers{names} are in the model still: the diagnosis has no others.",)


def _moved_by_fit(rig: Rig) -> tuple[str, ...]:
    """Names of the parameters that the fit of the rig file moved, tolerances included, as far as the file says."""
    told = (rig.provenance.get(name) for name in ("free", "before"))
    names = [str(name) for each in told if isinstance(each, list | tuple | Mapping) for name in each]
    return tuple(dict.fromkeys(names))


def _doubts_of_diagnosis(document: Mapping[str, object]) -> tuple[str, ...]:
    return () if document.get("converged", True) else ("The diagnosis did not converge.",)


def _doubts_of_draws(
    model: ExportedModel, draws: Mapping[str, Draws], added: tuple[str, ...], path: Path
) -> list[str]:
    """Whether the draws, all of them, are those of this model."""
    own = [entry.name for name in added for entry in EFFECTS[name].parameters]
    lacking = [name for name in own if name not in draws]
    doubts = []
    if lacking:
        doubts.append(
            f"{path} is the posterior of a model without {' and '.join(added)}: it has no draws of "
            f"{', '.join(lacking)}, and its other draws are not those of the exported model."
        )
    far = far_from_draws(model.table.as_dict(), draws)
    if far:
        doubts.append(
            f"{path} lies elsewhere than the model: {', '.join(far[:4])} {'is' if len(far) == 1 else 'are'} more "
            f"than {FAR:g} standard deviations off its draws."
        )
    return doubts
