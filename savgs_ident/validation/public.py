"""What ``import savgs_ident`` offers of virtual rigs: campaigns as a rig with known parameters would record them.

    truth = draw_truth(model, seed=3) | {"mount_compliance": 1.5e-6, "mount_damping": 400.0}
    campaign = simulate_campaign(model, truth, effects=("mount_compliance",), seed=3)

The motions are integrated in time, by another method than the one that models are fitted with; the samples have the
noise of the sensors, and their stamps jitter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from savgs_ident.core.files import prepare_folder
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.simulate.public import DWELLS
from savgs_ident.validation.blind_draw import draw_rig
from savgs_ident.validation.blind_record import Answer, record_campaign
from savgs_ident.validation.blind_record import write_campaign as write_recordings
from savgs_ident.validation.virtual_rig import Bench, Programme


def draw_truth(model: RigModel, seed: int | np.random.Generator = 1) -> dict[str, float]:
    """Parameters of a rig [SI] that is off its drawing: normal about the drawing's, by their tolerances."""
    return draw_rig(_bench(model, Programme()), np.random.default_rng(seed))


def simulate_campaign(
    model: RigModel,
    truth: Mapping[str, float],
    effects: Sequence[str] = (),
    *,
    dwells: Sequence[float] = DWELLS,
    sweep: float = 0.0,
    seed: int | np.random.Generator = 1,
    start: datetime | None = None,
) -> Campaign:
    """The campaign that a rig would have recorded: dwells, a sweep if asked for, a standstill.

    Args:
        model: the rig with the effects that are known.
        truth: the parameters that differ from the model's, those of ``effects`` among them [SI].
        effects: what acts on the rig besides.
        dwells: frequencies of the cam [Hz].
        sweep: length of a sweep [s]; none if zero.
        seed: of the noise.
        start: when the recording begins; its clock counts from zero if left out.

    Raises :class:`InputError` for a rig that does not come to a steady motion.
    """
    use_persistent_cache()
    bench = _bench(model, Programme(dwells=tuple(dwells), sweep=sweep))
    answer = Answer(1, "none", tuple(effects), (), {}, {}, (), {}, truth, ())
    recordings = record_campaign(bench, answer, np.random.default_rng(seed))
    if start is not None:
        recordings = tuple(_begun(each, start.timestamp()) for each in recordings)
    return Campaign("simulated", recordings, (), "", RIG_LAYOUT)


def write_campaign(campaign: Campaign, folder: str | Path) -> Path:
    """Write a campaign to ``campaign.csv.gz`` in a folder, as the shipped one is written; its path.

    Raises :class:`InputError` if it cannot be written.
    """
    return write_recordings(campaign.recordings, prepare_folder(Path(folder)))


def _bench(model: RigModel, programme: Programme) -> Bench:
    return Bench(model.rig, model.effects, model.free(), programme)


def _begun(recording: Recording, start: float) -> Recording:
    """The recording with a clock that has the date, ``start`` being its first instant [s since 1970]."""
    channels = {name: replace(each, time=each.time + start) for name, each in recording.channels.items()}
    return replace(recording, channels=channels)
