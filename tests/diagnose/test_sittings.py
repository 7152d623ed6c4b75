"""Where something unknown sits: what stands alone and what stands beside an effect, together."""

import numpy as np
import pytest

from savgs_ident.diagnose.engine.attribution import Attribution, anywhere
from savgs_ident.diagnose.sittings import (
    ALONE,
    Sitting,
    at_and_elsewhere,
    by_place,
    may_be_imitated,
    sittings_of,
)


def _places(**evidence: float) -> tuple[Attribution, ...]:
    none = np.zeros(0)
    return tuple(Attribution(name, 0.0, 0.0, each, none, none) for name, each in evidence.items())


def test_a_place_weighs_by_all_that_may_be_there() -> None:
    alone = sittings_of(_places(rail=-10.0, strut=-12.0))
    beside = sittings_of(_places(rail=-9.0, strut=-5.0), -4.0)
    weights = by_place((*alone, *beside))
    assert list(weights) == ["strut", "rail"]
    assert weights["strut"] == pytest.approx(np.log(np.exp(-12.0) + np.exp(-9.0)))
    assert weights["rail"] == pytest.approx(np.log(np.exp(-10.0) + np.exp(-13.0)))


def test_a_stand_in_shows_where_what_it_leaves_sits() -> None:
    alone = sittings_of(_places(suspension=-940.0, strut=-988.0))
    assert next(iter(by_place(alone))) == "suspension"
    beside = sittings_of(_places(suspension=-834.0, strut=-644.0), -4.4)
    assert next(iter(by_place((*alone, *beside)))) == "strut"


def test_a_place_and_all_others_are_what_a_law_anywhere_is() -> None:
    places = _places(rail=-10.0, strut=-12.0, road=-11.0)
    here, elsewhere = at_and_elsewhere(sittings_of(places), "strut")
    assert np.logaddexp(here, elsewhere) == pytest.approx(anywhere(places))
    assert here == pytest.approx(-12.0 - np.log(3.0))


def test_a_place_that_nothing_sits_at_has_no_weight() -> None:
    here, elsewhere = at_and_elsewhere((Sitting("rail", 3.0),), "strut")
    assert here == -np.inf
    assert elsewhere == pytest.approx(3.0)


def test_an_effect_stands_in_only_for_what_explains_much_alone() -> None:
    places = _places(strut=-3169.0, suspension=-3284.0, link=-3600.0)
    without = -3665.0
    assert ALONE * (3665.0 - 3169.0) < 3665.0 - 3284.0
    assert may_be_imitated(places, without) == {"strut", "suspension"}
    assert may_be_imitated(places, -3170.0) == {"strut"}
