"""Some of the tests of a response, and the tests of two responses as one."""

from dataclasses import replace
from typing import Any, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.responses.harmonic_response import WHOLE_PERIOD, ComparedPart, HarmonicResponse

_BY_CHANNEL = ("peak_to_peak", "peak_to_peak_sd", "noise_sd")
_BY_TEST = ("frequency", "frequency_sd", "periods", *_BY_CHANNEL)
_BY_ORDER = ("harmonics", "covariance", "valid")


def only_tests(response: HarmonicResponse, kept: NDArray[np.integer]) -> HarmonicResponse:
    """Those of its tests, by their places; as a response of dwells where they all are."""
    dof, recorded = response.covariance_dof, response.recorded
    part = None if response.part is None else ComparedPart(*(each[kept] for each in response.part))
    found = replace(
        response,
        tests=tuple(response.tests[d] for d in kept),
        covariance_dof=None if dof is None else dof[kept],
        recorded=None if recorded is None else recorded[kept],
        part=part,
        initial_states=None if response.initial_states is None else response.initial_states.of_tests(kept),
        beside={name: each[kept] for name, each in response.beside.items()},
        **{name: getattr(response, name)[kept] for name in (*_BY_TEST, *_BY_ORDER)},
    )
    return _without_windows(found) if part is not None and part.repeats.all() else found


class SelectableResult(Protocol):
    """A result for the tests of a response."""

    @property
    def measured(self) -> HarmonicResponse | None:
        """The response."""
        ...

    def of_tests(self, kept: NDArray[np.intp]) -> Self:
        """The same for some of the tests, by their places."""
        ...


Selected = TypeVar("Selected", bound=SelectableResult)


def by_kind(result: Selected) -> tuple[Selected | None, Selected | None]:
    """The result for the dwells, and for the windows; None where there are none, both without a response."""
    measured = result.measured
    if measured is None:
        return None, None
    if not measured.windows.size:
        return result, None
    if not measured.dwells.size:
        return None, result
    return result.of_tests(measured.dwells), result.of_tests(measured.windows)


def _without_windows(response: HarmonicResponse) -> HarmonicResponse:
    """The same of dwells alone, which have not as many orders as the inputs of windows."""
    orders = np.flatnonzero(response.valid.any(axis=(0, 1)))
    upto = 1 + int(orders.max(initial=0))
    dof = response.covariance_dof
    return replace(
        response,
        part=None,
        initial_states=None,
        covariance_dof=None if dof is None else dof[:, :, :upto],
        **{name: getattr(response, name)[:, :, :upto] for name in _BY_ORDER},
    )


def join_tests(dwells: HarmonicResponse, windows: HarmonicResponse) -> HarmonicResponse:
    """Dwells, and after them windows of tests that do not repeat, in one response.

    Both are in the same channels, of which either may lack some. When they were recorded has to be known of both on
    one scale.
    """
    assert windows.part is not None
    channels = tuple(dict.fromkeys((*dwells.channels, *windows.channels)))
    orders = max(dwells.orders, windows.orders)
    wide = [_widened(each, channels, orders) for each in (dwells, windows)]
    whole = np.repeat(np.concatenate(WHOLE_PERIOD)[:, None], len(dwells.tests), axis=1)
    names = dict.fromkeys((*dwells.beside, *windows.beside))
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in wide])
        for name in (*_BY_TEST, *_BY_ORDER, "covariance_dof")
    }
    return replace(
        wide[0],
        tests=dwells.tests + windows.tests,
        warnings=tuple(dict.fromkeys((*dwells.warnings, *windows.warnings))),
        recorded=np.concatenate([dwells.times, windows.times]),
        part=ComparedPart(*(np.concatenate(each) for each in zip(whole, windows.part, strict=True))),
        beside={name: np.concatenate([_beside(each, name) for each in wide]) for name in names},
        **joined,
    )


def _widened(response: HarmonicResponse, channels: tuple[str, ...], orders: int) -> HarmonicResponse:
    """The same with room for more channels and orders, of which nothing is known."""
    places = [channels.index(name) for name in response.channels]

    def in_channels(values: NDArray[np.float64]) -> NDArray[np.float64]:
        wide = np.zeros((values.shape[0], len(channels), *values.shape[2:]), values.dtype)
        wide[:, places] = values
        return wide

    def in_orders(values: NDArray[np.float64]) -> NDArray[np.float64]:
        more = [(0, 0), (0, 0), (0, orders - response.orders), *[(0, 0)] * (values.ndim - 3)]
        return np.pad(in_channels(values), more)

    wide: dict[str, Any] = {name: in_orders(getattr(response, name)) for name in _BY_ORDER}
    wide |= {name: in_channels(getattr(response, name)) for name in _BY_CHANNEL}
    return replace(response, channels=channels, covariance_dof=in_orders(_dof(response)), **wide)


def _dof(response: HarmonicResponse) -> NDArray[np.float64]:
    """Degrees of freedom behind the covariance (D, C, K); infinite where it is known."""
    known = response.covariance_dof
    return np.full(response.valid.shape, np.inf) if known is None else known


def _beside(response: HarmonicResponse, name: str) -> NDArray[np.float64]:
    return response.beside.get(name, np.full(len(response.tests), np.nan))
