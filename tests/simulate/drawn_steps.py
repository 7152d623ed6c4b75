"""Steps of recurrences, drawn at random: coupled oscillators and states, on nodes that are not even."""

from typing import NamedTuple

import numpy as np

from savgs_ident.simulate.collocation import Steps
from savgs_ident.simulate.mesh import Layout


class Drawn(NamedTuple):
    """Steps, the weights of their far ends, right sides, A_n, B_n and F_n put together entry by entry, (P, m, m)."""

    steps: Steps
    weight: np.ndarray
    right: np.ndarray
    far: np.ndarray
    near: np.ndarray
    flow: np.ndarray

    @property
    def given(self) -> tuple[Steps, np.ndarray, np.ndarray]:
        return self.steps, self.weight, self.right


def draw(seed: int, layout: Layout, places: int, states: int, decay: float) -> Drawn:
    """Steps of oscillators that are coupled and damped, some states slipping, and right sides of unlike sizes.

    Everything decays by about ``decay`` in a node.
    """
    rng = np.random.default_rng(seed)
    rows, size, total = places + states, 2 * places + states, layout.total
    drawn = rng.standard_normal((total, rows, rows))
    damping = decay * (np.eye(rows) + 0.2 * drawn / np.linalg.norm(drawn, 2, axis=(1, 2), keepdims=True))
    flow = np.zeros((total, size, size))
    flow[:, places:, places:] = -damping
    flow[:, np.arange(places), places + np.arange(places)] = 1.0
    flow[:, places : 2 * places, :places] = -rng.uniform(0.1, 0.4, (total, 1, 1)) * np.eye(places)
    weight = np.concatenate([np.full(2 * places, 0.5), rng.choice([0.5, 1.0], states)])[:, None]
    after = rng.uniform(0.5, 2.0, total)
    before, eye = after[layout.preceding], np.eye(size)
    far = eye - before[:, None, None] * weight * flow
    near = eye + after[:, None, None] * (1.0 - weight) * flow
    lower = np.moveaxis(np.linalg.inv(far)[:, places:], 0, -1)
    right = rng.standard_normal((size, total)) * 10.0 ** rng.uniform(-3.0, 3.0, (size, 1))
    return Drawn(Steps(lower, before, after / before), weight, right, far, near, flow)
