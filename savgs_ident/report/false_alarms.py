"""What campaigns with nothing missing say of false alarms: as JSON, in words and as a picture."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from savgs_ident.diagnose.false_alarms import CONFIDENCE, NullDraw, rate_bound
from savgs_ident.diagnose.verdict import SURE
from savgs_ident.report.numerals import decimal, percentage
from savgs_ident.report.style import BLUE, INK, ORANGE, new_figure, styled

MOST = 0.02
"""Rate of false alarms that is allowed."""


def alarms_record(draws: Sequence[NullDraw], odds: float, command: Sequence[str]) -> dict[str, Any]:
    """How many of the draws were false alarms, the rate that they leave possible, and all odds.

    Odds are log odds.
    """
    solved = [each.odds for each in draws if each.odds is not None]
    alarms = sum(each.alarm for each in draws)
    return {
        "schema": 1,
        "few_enough": bool(solved) and alarms <= MOST * len(solved),
        "drawn": len(solved),
        "not_solved": len(draws) - len(solved),
        "alarms": alarms,
        "rate_at_most": rate_bound(alarms, len(solved)),
        "confidence": CONFIDENCE,
        "threshold": SURE,
        "odds": odds,
        "drawn_odds": solved,
        "named": [list(each.named) for each in draws if each.alarm],
        "command": " ".join(command),
    }


def alarms_text(record: Mapping[str, Any]) -> str:
    """The same in two sentences."""
    lost = f" ({record['not_solved']} more could not be solved)" if record["not_solved"] else ""
    told = (
        f"Of {record['drawn']} campaigns like this one with nothing missing{lost}, something was said to be missing "
        f"in {record['alarms']}: the rate of false alarms is at most {percentage(record['rate_at_most'])} "
        f"({percentage(record['confidence'], 0)} confidence)."
    )
    if not record["drawn_odds"]:
        return told
    return (
        f"{told} Their log odds that something is missing are {decimal(min(record['drawn_odds']), 1)} to "
        f"{decimal(max(record['drawn_odds']), 1)}, those of this campaign {decimal(record['odds'], 1)}; an alarm is "
        f"given from {decimal(record['threshold'], 0)} on."
    )


def alarms_figure(draws: Sequence[NullDraw], odds: float) -> Figure:
    """Histogram of the log odds of the draws, with those of the campaign and the threshold."""
    solved = np.array([each.odds for each in draws if each.odds is not None])
    with styled():
        figure = new_figure(6.4, 3.4)
        axes = figure.subplots()
        axes.hist(
            solved, bins="sturges", color=BLUE, alpha=0.75, rwidth=0.9, label="campaigns with nothing missing"
        )
        axes.axvline(SURE, color=INK, linestyle="--", label="an alarm is given from here on")
        # Odds of a campaign in which something is missing are in the thousands: they would leave the rest no room.
        shown = min(odds, 2.0 * SURE)
        there = "this campaign" if odds <= shown else f"this campaign: {odds:.0f}, far to the right"
        axes.axvline(shown, color=ORANGE, label=there)
        axes.set_xlabel("log odds that something is missing [nat]")
        axes.set_ylabel("campaigns")
        axes.set_title(f"{solved.size} campaigns with nothing missing, diagnosed")
        axes.legend(loc="upper center", fontsize=8)
    return figure
