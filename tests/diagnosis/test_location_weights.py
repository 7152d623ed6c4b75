"""Where something unknown acts: laws alone and laws beside an effect, together."""

import numpy as np
import pytest

from savgs_ident.diagnosis.localisation import Localisation, anywhere
from savgs_ident.diagnosis.model_selection import (
    LocationWeight,
    may_be_imitated,
    weight_by_location,
    weights_here_and_elsewhere,
    weights_of,
)
from savgs_ident.diagnosis.thresholds import DEFAULTS


def _localisations(**evidence: float) -> tuple[Localisation, ...]:
    none = np.zeros(0)
    return tuple(Localisation(name, 0.0, 0.0, each, none, none) for name, each in evidence.items())


def test_a_location_weighs_by_all_that_may_be_there() -> None:
    alone = weights_of(_localisations(rail=-10.0, strut=-12.0))
    beside = weights_of(_localisations(rail=-9.0, strut=-5.0), -4.0)
    weights = weight_by_location((*alone, *beside))
    assert list(weights) == ["strut", "rail"]
    assert weights["strut"] == pytest.approx(np.log(np.exp(-12.0) + np.exp(-9.0)))
    assert weights["rail"] == pytest.approx(np.log(np.exp(-10.0) + np.exp(-13.0)))


def test_a_stand_in_shows_where_what_it_leaves_sits() -> None:
    alone = weights_of(_localisations(suspension=-940.0, strut=-988.0))
    assert next(iter(weight_by_location(alone))) == "suspension"
    beside = weights_of(_localisations(suspension=-834.0, strut=-644.0), -4.4)
    assert next(iter(weight_by_location((*alone, *beside)))) == "strut"


def test_a_location_and_all_others_are_what_a_law_anywhere_is() -> None:
    localisations = _localisations(rail=-10.0, strut=-12.0, road=-11.0)
    here, elsewhere = weights_here_and_elsewhere(weights_of(localisations), "strut")
    assert np.logaddexp(here, elsewhere) == pytest.approx(anywhere(localisations))
    assert here == pytest.approx(-12.0 - np.log(3.0))


def test_a_location_that_nothing_sits_at_has_no_weight() -> None:
    here, elsewhere = weights_here_and_elsewhere((LocationWeight("rail", 3.0),), "strut")
    assert here == -np.inf
    assert elsewhere == pytest.approx(3.0)


def test_an_effect_stands_in_only_for_what_explains_much_alone() -> None:
    localisations = _localisations(strut=-3169.0, suspension=-3284.0, link=-3600.0)
    without = -3665.0
    assert DEFAULTS.stand_in_share * (3665.0 - 3169.0) < 3665.0 - 3284.0
    assert may_be_imitated(localisations, without) == {"strut", "suspension"}
    assert may_be_imitated(localisations, -3170.0) == {"strut"}
