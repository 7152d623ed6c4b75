"""What many campaigns say together, in words."""

from math import isfinite

from savgs_ident.fit.trend import Line, Trend
from savgs_ident.report.campaigns_study import CampaignRow, Identified, RowStatus, Study
from savgs_ident.report.numerals import DASH, decimal, interval, numeral, with_error


def parameter_words(told: Identified) -> str:
    """Value, error and unit: ``5790 ± 12 N s/m``."""
    if not isfinite(told.stderr):
        return f"{value_words(told)} by the data"
    return with_unit(value_words(told), told.unit)


def value_words(told: Identified) -> str:
    """Value and error in the parameter's unit, for a column that is headed by it: ``5790 ± 12``."""
    if not isfinite(told.stderr):
        return f"{numeral(told.value, told.stderr)}, not told"
    return with_error(told.value, told.stderr)


def parameter_headers(study: Study) -> tuple[str, ...]:
    """The names of the parameters with their units, to head a column each."""
    return tuple(name if unit == "1" else f"{name} [{unit}]" for name, unit in study.units.items())


def with_unit(text: str, unit: str) -> str:
    """A number with its unit, if it has one."""
    return text if unit == "1" else f"{text} {unit}"


def row_words(row: CampaignRow) -> str:
    """A campaign in a line: what was identified, or why it was not."""
    if row.status is RowStatus.failed:
        return f"{row.name} failed: {row.reason}"
    told = ", ".join(f"{name} {parameter_words(each)}" for name, each in row.parameters.items())
    return f"{row.name}: {told}" + (f" (not to be trusted: {row.reason})" if row.reason else "")


def headline(study: Study) -> str:
    """What came out, in one sentence."""
    there = len(study.rows)
    done = f"{study.count(RowStatus.ok)} of {there} campaign{'s' * (there != 1)} identified"
    moving = [name for name, trend in study.trends.items() if trend.line and trend.line.rises_or_falls]
    apart = [name for name, trend in study.trends.items() if trend.mean.scatter.beyond_errors]
    if not any(trend.line for trend in study.trends.values()):
        return f"{done}."
    if moving:
        return f"{done}; {_listed(moving)} change{'s' * (len(moving) == 1)} {over(study)}."
    if apart:
        return f"{done}; {_listed(apart)} scatter{'s' * (len(apart) == 1)} more than the errors say, without a trend."
    return f"{done}; no parameter changes."


def over(study: Study) -> str:
    """What trends are over."""
    return "with time" if study.by_time else "from campaign to campaign"


def alarm(study: Study) -> str:
    """Why not everything is to be trusted; empty if it is."""
    failed, doubtful = study.count(RowStatus.failed), study.count(RowStatus.not_trusted)
    told = []
    if failed:
        told.append(f"{failed} of {len(study.rows)} campaigns failed")
    if doubtful:
        told.append(f"{doubtful} of {len(study.rows)} campaigns {_are(doubtful)} not to be trusted")
    return f"{' and '.join(told)}; the trends are without {_them(failed + doubtful)}." if told else ""


def slope_words(study: Study, name: str, line: Line) -> str:
    """The change of a parameter with its interval: ``+0.0010 (0.0002 to 0.0018) per day``."""
    low, high = line.slope_interval
    sign = "+" if line.slope > 0.0 else ""
    change = f"{sign}{numeral(line.slope, line.slope_stderr)} ({interval(low, high, line.slope_stderr)})"
    return f"{with_unit(change, study.units[name])} per {study.per}"


def trend_words(trend: Trend) -> str:
    """Whether there is a trend, in a word."""
    if trend.line is None:
        return DASH
    if not trend.line.rises_or_falls:
        return "none"
    return "rises" if trend.line.slope > 0.0 else "falls"


def scatter_words(trend: Trend) -> str:
    """Chi2 of the mean over its degrees of freedom, and whether it is more than chance."""
    scatter = trend.mean.scatter
    if scatter.dof == 0:
        return DASH
    ratio = decimal(scatter.chi2 / scatter.dof, 2)
    return f"{ratio}, more than the errors" if scatter.beyond_errors else ratio


def widening_words(study: Study) -> tuple[str, ...]:
    """What was done where campaigns scatter more than their errors, a sentence a parameter."""
    told = []
    for name, trend in study.trends.items():
        widened = []
        if trend.mean.scatter.widening > 1.0:
            widened.append(f"of the mean {decimal(trend.mean.scatter.widening, 1)} times")
        if trend.line is not None and trend.line.scatter.widening > 1.0:
            widened.append(f"of the trend {decimal(trend.line.scatter.widening, 1)} times")
        if widened:
            told.append(
                f"{name} scatters more than the errors say: the error {' and '.join(widened)} widened to the scatter."
            )
    return tuple(told)


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _are(count: int) -> str:
    return "is" if count == 1 else "are"


def _them(count: int) -> str:
    return "it" if count == 1 else "them"
