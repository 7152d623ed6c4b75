"""Fourteen days on a rig whose rail wears: simulated recordings, to see what `savgs-ident campaign` makes of them.

The rig is off its drawing by its tolerances, the same on all days; the friction of its rail rises by half a per cent
a day. On the fourth day the sensors were not connected, and on the ninth only slow dwells were recorded.

    python examples/wearing_rail.py recordings
    savgs-ident campaign recordings
"""

import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from savgs_ident.core.rig import default_rig_path, read_rig
from savgs_ident.diagnose.blind.answer import Answer
from savgs_ident.diagnose.blind.bench import Bench
from savgs_ident.diagnose.blind.draw import draw_rig
from savgs_ident.diagnose.blind.log import write_campaign
from savgs_ident.diagnose.blind.programme import DWELLS, Programme
from savgs_ident.diagnose.blind.record import record_campaign
from savgs_ident.effects.registry import MODELS
from savgs_ident.fit.least_squares import FREE
from savgs_ident.recordings.recording import Recording
from savgs_ident.simulate.compilation import use_persistent_cache

DAYS, FIRST = 14, datetime(2026, 3, 2, 8, tzinfo=UTC)
RISE = 0.005
"""Rise of the rail's friction in a day, relative."""

UNCONNECTED, SLOW = 4, 9
"""The days on which something went wrong."""


def began(recording: Recording, when: datetime) -> Recording:
    """The recording with a clock that tells the date."""
    start = when.timestamp()
    channels = {name: replace(each, time=each.time + start) for name, each in recording.channels.items()}
    return replace(recording, channels=channels)


def main(folder: Path) -> None:
    """Write a campaign for each day."""
    use_persistent_cache()
    drawing, random = read_rig(default_rig_path()), np.random.default_rng(14)
    rig = draw_rig(Bench(drawing, MODELS["simtr"], FREE), random)
    for day in range(DAYS):
        dwells = DWELLS[:12:2] if day + 1 == SLOW else DWELLS[::2] + DWELLS[-1:]
        bench = Bench(drawing, MODELS["simtr"], FREE, Programme(dwells))
        worn = rig | {"mu_r": rig["mu_r"] * (1.0 + RISE * day)}
        truth = Answer(day, "none", (), (), {}, {}, (), {}, worn, ())
        there = folder / f"day{day + 1:02d}"
        there.mkdir(parents=True, exist_ok=True)
        if day + 1 == UNCONNECTED:
            (there / "campaign.csv").write_text("test,time [s],road_height [m]\n")
            continue
        recordings = record_campaign(bench, truth, random)
        write_campaign([began(each, FIRST + timedelta(days=day)) for each in recordings], there)
        print(f"day {day + 1:2d}: mu_r = {worn['mu_r']:.5f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
