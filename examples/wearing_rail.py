"""Fourteen days on a rig whose rail wears: simulated recordings, to see what `savgs-ident campaign` makes of them.

The rig is off its drawing by its tolerances, the same on all days; the friction of its rail rises by half a per cent
a day. On the fourth day the sensors were not connected, and on the ninth only slow dwells were recorded.

    python examples/wearing_rail.py recordings
    savgs-ident campaign recordings
"""

import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

import savgs_ident as si

DAYS, FIRST = 14, datetime(2026, 3, 2, 8, tzinfo=UTC)
RISE = 0.005
"""Rise of the rail's friction in a day, relative."""

UNCONNECTED, SLOW = 4, 9
"""The days on which something went wrong."""


def main(folder: Path) -> None:
    """Write a campaign for each day."""
    model, random = si.load_model(), np.random.default_rng(14)
    rig = si.draw_truth(model, random)
    for day in range(DAYS):
        dwells = si.DWELLS[:12:2] if day + 1 == SLOW else si.DWELLS[::2] + si.DWELLS[-1:]
        worn = rig | {"mu_r": rig["mu_r"] * (1.0 + RISE * day)}
        there = folder / f"day{day + 1:02d}"
        if day + 1 == UNCONNECTED:
            there.mkdir(parents=True, exist_ok=True)
            (there / "campaign.csv").write_text("test,time [s],road_height [m]\n")
            continue
        began = FIRST + timedelta(days=day)
        campaign = si.simulate_campaign(model, worn, dwells=dwells, seed=random, start=began)
        si.write_campaign(campaign, there)
        print(f"day {day + 1:2d}: mu_r = {worn['mu_r']:.5f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
