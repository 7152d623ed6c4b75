"""The rows of a posterior's tables, every cell a text, rounded to what its error justifies."""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from savgs_ident.posterior.result import Marginal, Posterior
from savgs_ident.report.numerals import (
    DASH,
    count,
    decimal,
    interval,
    numeral,
    percentage,
    signed,
    unit_text,
    with_error,
)
from savgs_ident.report.posterior_words import NUISANCE_WORDS, shift_in_sd, short

_NORMAL_95 = 1.959964
_LEAST_WIDE = 1.2


@dataclass(frozen=True)
class Strip:
    """Where two intervals lie on a common scale from 0 to 100 per cent, the one before the data and the one after.

    ``words`` says the same for those who cannot see it.
    """

    prior_from: float
    prior_wide: float
    from_: float
    wide: float
    words: str


@dataclass(frozen=True)
class MarginalRow:
    """An identified parameter or a scale of the likelihood."""

    name: str
    about: str
    median: str
    sd: str
    interval: str
    unit: str
    contraction: str
    place: Strip | None


@dataclass(frozen=True)
class ToleranceRow:
    """A parameter that was known to a tolerance, before and after."""

    name: str
    about: str
    before: str
    after: str
    unit: str
    shift: str
    contraction: str


@dataclass(frozen=True)
class DiagnosticRow:
    """How well one parameter was sampled; ``over_laplace`` is the ratio of the standard deviations."""

    name: str
    r_hat: str
    ess_bulk: str
    ess_tail: str
    autocorrelation: str
    over_laplace: str


@dataclass(frozen=True)
class OrderRow:
    """How many measured harmonics of one order lie inside, a cell for each channel."""

    order: int
    cells: tuple[str, ...]


def marginal_row(each: Marginal) -> MarginalRow:
    """One line of the table of identified parameters or of the likelihood's scales."""
    return MarginalRow(
        name=each.name,
        about=NUISANCE_WORDS.get(each.name, each.about) if each.role == "nuisance" else short(each.about),
        median=numeral(each.median, each.sd),
        sd=numeral(each.sd, each.sd),
        interval=interval(each.q025, each.q975, each.sd),
        unit=unit_text(each.unit),
        contraction=percentage(each.contraction),
        place=_strip(each),
    )


def tolerance_row(each: Marginal) -> ToleranceRow:
    """One line of the table of what was known to a tolerance."""
    low, high = each.prior
    middle, deviation = 0.5 * (low + high), (high - low) / (2.0 * _NORMAL_95)
    return ToleranceRow(
        name=each.name,
        about=short(each.about),
        before=with_error(middle, deviation),
        after=with_error(each.median, each.sd),
        unit=unit_text(each.unit),
        shift=signed(shift_in_sd(each), 1),
        contraction=percentage(each.contraction, 0),
    )


def diagnostic_row(each: Marginal) -> DiagnosticRow:
    """One line of the table of convergence by parameter."""
    return DiagnosticRow(
        name=each.name,
        r_hat=decimal(each.r_hat, 3),
        ess_bulk=count(each.ess_bulk),
        ess_tail=count(each.ess_tail),
        autocorrelation=decimal(each.autocorrelation, 1),
        over_laplace=decimal(each.sd / each.laplace_sd, 2) if each.laplace_sd > 0.0 else DASH,
    )


def order_rows(posterior: Posterior) -> tuple[OrderRow, ...]:
    """Measured harmonics inside the 95 % region, by order and channel; only orders that are compared."""
    used = posterior.predictive.used
    inside = posterior.predictive.inside & used
    return tuple(
        OrderRow(int(k), tuple(_of(inside[:, c, k].sum(), used[:, c, k].sum()) for c in range(used.shape[1])))
        for k in np.flatnonzero(np.any(used, axis=(0, 1)))
    )


def _of(part: int, whole: int) -> str:
    return f"{part} of {whole}" if whole else DASH


def _strip(each: Marginal) -> Strip | None:
    """None where nothing was known beforehand."""
    low, high = each.prior
    start, end = min(low, each.q025), max(high, each.q975)
    if not (isfinite(start) and isfinite(end) and end > start):
        return None

    def at(value: float) -> float:
        return 100.0 * (value - start) / (end - start)

    # An interval that has shrunk to nothing is still to be seen.
    wide = max(at(each.q975) - at(each.q025), _LEAST_WIDE)
    from_ = min(max(0.5 * (at(each.q975) + at(each.q025)) - 0.5 * wide, 0.0), 100.0 - wide)
    words = (
        f"before {interval(low, high, 0.01 * (high - low))}, after {interval(each.q025, each.q975, each.sd)}"
    )
    return Strip(round(at(low), 2), round(at(high) - at(low), 2), round(from_, 2), round(wide, 2), words)
