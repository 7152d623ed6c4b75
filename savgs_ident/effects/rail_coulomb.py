"""Friction of the railway carriages, eqs. (1)-(2) of the paper.

The carriages carry |F_Nt| + |F_Nb| and slide with

    F_c = mu_r (|F_Nt| + |F_Nb|),

the same up and down. How they stick before they slide is the rail's (:mod:`savgs_ident.model.bristle`).
"""

from collections.abc import Mapping
from typing import ClassVar

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractGrip, Grip, InternalState, Port, PortSignals
from savgs_ident.model.values import Values


class RailCoulomb(AbstractGrip):
    """Load-dependent Coulomb friction of the rail."""

    name: ClassVar[str] = "rail_coulomb"
    port: ClassVar[Port] = Port.RAIL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5, about="rail friction coefficient"),
        Parameter("k_pre", 1e7, "N/m", tolerance=1e6, lower=1e5, about="presliding stiffness of the rail"),
        Parameter("c_pre", 3e4, "N s/m", tolerance=3e3, lower=0.0, about="presliding damping of the rail"),
    )
    null: ClassVar[Mapping[str, float]] = {"mu_r": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the sprung mass sticks at each reversal and odd orders of its acceleration grow"
    reference: ClassVar[str] = "Yu et al. 2017, eqs. (1)-(2)"

    def grip(self, p: Values, signals: PortSignals) -> Grip:
        """The friction [N] in both directions."""
        slide = p["mu_r"] * signals.load
        return Grip(slide, slide)
