"""What drives the rig at an instant."""

from collections.abc import Mapping
from typing import NamedTuple

from jaxtyping import Array

from savgs_ident.effects.base import Fundamental
from savgs_ident.plants.quarter_car.strut import Link
from savgs_ident.plants.quarter_car.tyre import Road


class Inputs(NamedTuple):
    """What drives the rig: road and link; the cam behind the road and what is imposed at ports, if anything."""

    road: Road
    link: Link
    cam: Fundamental | None = None
    imposed: Mapping[str, Array] | None = None
