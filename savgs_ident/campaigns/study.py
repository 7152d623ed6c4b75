"""Many campaigns of one rig together: a row each, in the order of time, and what follows from all of them.

Times count where every campaign that was read says when it began; otherwise the order is that of the names, and a
trend is one over the number in that order.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.campaigns.trends import Trend, follow
from savgs_ident.core.presentation import Origin, Result

_HOUR, _DAY = 3600.0, 86400.0
_LONG = 2.0 * _DAY
"""Campaigns over a longer time than this [s] have trends per day, others per hour."""


class RowStatus(StrEnum):
    """How a campaign ended."""

    ok = "ok"
    not_trusted = "not trusted"
    failed = "failed"


@dataclass(frozen=True)
class Identified:
    """A free parameter of one campaign, SI; ``stderr`` is infinite where the data do not identify it.

    ``own_stderr`` is its part that is not the same in all campaigns (:mod:`savgs_ident.campaigns.trends`).
    """

    value: float
    stderr: float
    own_stderr: float
    unit: str

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.value:.5g} ± {self.stderr:.2g}{unit}"

    @property
    def common_stderr(self) -> float:
        """The part of the standard error that is the same in all campaigns."""
        return float(np.sqrt(max(self.stderr**2 - self.own_stderr**2, 0.0)))


@dataclass(frozen=True)
class CampaignRow:
    """One campaign.

    Attributes:
        name: unique among the campaigns.
        source: where the recordings are.
        status: how it ended.
        reason: why it failed or is not to be trusted, in one line; else empty.
        start: when it began [s since 1970, UTC]; None if not known.
        chi2_per_dof: how well the model fits [1]; None where it was not fitted.
        parameters: the free parameters by name; empty where it was not fitted.
        data_sha256: digest of the recordings, empty where they were not read.
        unreadable: whether the campaign itself could not be used.
    """

    name: str
    source: str
    status: RowStatus
    reason: str
    start: float | None
    chi2_per_dof: float | None
    parameters: Mapping[str, Identified]
    data_sha256: str = ""
    unreadable: bool = False

    @property
    def failure(self) -> str:
        """What is wrong with it, in a line; empty if nothing is."""
        if self.status is RowStatus.failed:
            return f"Failed: {self.name}: {self.reason}"
        return "" if self.status is RowStatus.ok else f"Not to be trusted: {self.name}: {self.reason}."

    def __str__(self) -> str:
        if self.status is RowStatus.failed:
            return f"{self.name} failed: {self.reason}"
        values = ", ".join(f"{name} {each}" for name, each in self.parameters.items())
        doubt = f" (not to be trusted: {self.reason})" if self.reason else ""
        return f"{self.name}: {values}{doubt}"


@dataclass(frozen=True)
class CampaignStudy(Result):
    """The campaigns and what they say together.

    Attributes:
        rows: the campaigns in their order.
        by_time: whether ``place`` is a time, otherwise it is the number in order, from 1.
        place: of each row, (n,), [``per``] from the first campaign; NaN where a time is not known.
        per: what trends are per: "hour", "day" or "campaign".
        trends: of the parameters, from the campaigns that are to be trusted; none of those that no campaign
            identifies.
        notes: what else the reader should know, one sentence each.
        settings: what the results were made with besides data and rig.
    """

    presenter: ClassVar[str] = "CAMPAIGN_STUDY"

    rows: tuple[CampaignRow, ...]
    by_time: bool
    place: NDArray[np.float64]
    per: str
    trends: Mapping[str, Trend]
    notes: tuple[str, ...]
    settings: Mapping[str, Any]

    @property
    def trusted(self) -> bool:
        """Whether every campaign was identified and is to be trusted."""
        return all(row.status is RowStatus.ok for row in self.rows)

    @property
    def unreadable(self) -> bool:
        """Whether no campaign could be read."""
        return all(row.unreadable for row in self.rows)

    @property
    def failures(self) -> tuple[str, ...]:
        """What is wrong with each campaign that failed or is not to be trusted, a line each."""
        return tuple(row.failure for row in self.rows if row.failure)

    @property
    def units(self) -> dict[str, str]:
        """The free parameters and their units."""
        return {name: each.unit for row in self.rows for name, each in row.parameters.items()}

    @property
    def first(self) -> float | None:
        """When the first campaign began [s since 1970, UTC]; None if ``place`` is no time."""
        known = [row.start for row in self.rows if row.start is not None]
        return min(known) if self.by_time else None

    def count(self, status: RowStatus) -> int:
        """How many campaigns ended so."""
        return sum(row.status is status for row in self.rows)

    def counted(self, name: str) -> NDArray[np.bool_]:
        """Which rows count in the trend of a parameter, (n,)."""
        return np.array([_counts(row, name) for row in self.rows], dtype=bool)

    def values(self, name: str) -> NDArray[np.float64]:
        """Value, standard error and its own part of a parameter in every row, NaN where there is none: (3, n)."""
        known = (row.parameters.get(name) for row in self.rows)
        entry = [(e.value, e.stderr, e.own_stderr) if e else 3 * (np.nan,) for e in known]
        return np.array(entry).reshape(-1, 3).T


def row_of(
    name: str, source: str, record: Mapping[str, Any], start: float | None, data_sha256: str
) -> CampaignRow:
    """The row of a campaign that was fitted, from what its ``fit.json`` says.

    ``start`` is when it began [s since 1970, UTC].
    """
    ratio = record["chi2_per_dof"]
    trusted = bool(record["trusted"])
    return CampaignRow(
        name=name,
        source=source,
        status=RowStatus.ok if trusted else RowStatus.not_trusted,
        reason="" if trusted else str(record["doubt"]),
        start=start,
        chi2_per_dof=None if ratio is None else float(ratio),
        parameters={
            each: _identified(each, record)
            for each, entry in record["parameters"].items()
            if entry["free"] and entry["value"] is not None
        },
        data_sha256=data_sha256,
    )


def study_campaigns(
    rows: Sequence[CampaignRow], order: Callable[[str], Any], settings: Mapping[str, Any], origin: Origin
) -> CampaignStudy:
    """Put the campaigns in order and follow every free parameter; ``order`` is the key that sorts names.

    ``settings`` and ``origin`` are those of the result.
    """
    by_name = sorted(rows, key=lambda row: order(row.name))
    read = [row.start for row in by_name if row.status is not RowStatus.failed]
    starts = [start for start in read if start is not None]
    by_time = len(starts) == len(read) and len(set(starts)) > 1
    if by_time:
        by_name.sort(key=lambda row: np.inf if row.start is None else row.start)
        per = "day" if max(starts) - min(starts) > _LONG else "hour"
        unit = _DAY if per == "day" else _HOUR
        place = np.array(
            [np.nan if row.start is None else (row.start - min(starts)) / unit for row in by_name]
        )
    else:
        per, place = "campaign", np.arange(1.0, len(by_name) + 1.0)
    names = dict.fromkeys(name for row in by_name for name in row.parameters)
    trends = {name: trend for name in names if (trend := _followed(by_name, place, name)) is not None}
    notes = (*_order_notes(by_time, starts, read), *_copies(by_name))
    return CampaignStudy(tuple(by_name), by_time, place, per, trends, notes, settings, origin=origin)


def _identified(name: str, record: Mapping[str, Any]) -> Identified:
    entry = record["parameters"][name]
    stderr, own = (np.inf if entry[key] is None else float(entry[key]) for key in ("stderr", "own_stderr"))
    return Identified(float(entry["value"]), stderr, own, str(entry["unit"]))


def _followed(rows: Sequence[CampaignRow], place: NDArray[np.float64], name: str) -> Trend | None:
    used = [(at, row.parameters[name]) for at, row in zip(place, rows, strict=True) if _counts(row, name)]
    if not used:
        return None
    own = np.array([each.own_stderr for _, each in used])
    # The mean takes on what is in common as it takes on the values.
    common = np.average([each.common_stderr for _, each in used], weights=(own.min() / own) ** 2)
    return follow([at for at, _ in used], [each.value for _, each in used], own, float(common))


def _counts(row: CampaignRow, name: str) -> bool:
    entry = row.parameters.get(name)
    return row.status is RowStatus.ok and entry is not None and 0.0 < entry.stderr < np.inf


def _order_notes(by_time: bool, starts: Sequence[float], read: Sequence[object]) -> tuple[str, ...]:
    if by_time:
        return ("The order is that of the start times in the recordings.",)
    if len(read) < 2:
        return ()
    if len(starts) == len(read):
        return ("All recordings began at the same time: the order is that of their names.",)
    if starts:
        return (
            f"Only {len(starts)} of {len(read)} recordings say when they began: the order is that of their names.",
        )
    return ("The recordings do not say when they began: the order is that of their names.",)


def _copies(rows: Sequence[CampaignRow]) -> tuple[str, ...]:
    """A recording that is there twice counts twice, and the errors of what follows are too small."""
    owner: dict[str, str] = {}
    found = []
    for row in rows:
        if row.data_sha256 and row.data_sha256 in owner:
            found.append(f"{row.name} holds the same data as {owner[row.data_sha256]}: they count twice.")
        owner.setdefault(row.data_sha256, row.name)
    return tuple(found)
