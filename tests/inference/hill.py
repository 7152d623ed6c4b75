"""Densities over t that are known: what a surrogate is to a sampler."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


class NormalHill(eqx.Module):
    """A normal density with ``centre`` (n,) and ``precision`` (n, n), ``height`` at its top."""

    centre: Float[Array, " n"]
    precision: Float[Array, "n n"]
    height: float = 0.0

    def __call__(self, t: Float[Array, " n"]) -> Float[Array, ""]:
        """The log density."""
        off = t - self.centre
        return self.height - 0.5 * off @ self.precision @ off


class SkewHill(eqx.Module):
    """First coordinate the logarithm of a gamma variate of index ``index``, the second normal about it."""

    index: float

    def __call__(self, t: Float[Array, " 2"]) -> Float[Array, ""]:
        """The log density."""
        return self.index * t[0] - jnp.exp(t[0]) - 0.5 * ((t[1] - t[0]) / 0.6) ** 2

    def draws(self, random: np.random.Generator, count: int) -> np.ndarray:
        """Independent draws, (count, 2)."""
        first = np.log(random.gamma(self.index, size=count))
        return np.stack([first, first + 0.6 * random.standard_normal(count)], axis=1)


def a_normal_hill(size: int, seed: int = 8) -> NormalHill:
    """A tilted one, off the origin."""
    random = np.random.default_rng(seed)
    axes, _ = np.linalg.qr(random.standard_normal((size, size)))
    precision = axes @ np.diag(np.geomspace(0.5, 4.0, size)) @ axes.T
    return NormalHill(jnp.asarray(random.uniform(-1.0, 1.0, size)), jnp.asarray(precision), 7.5)


def assert_reversible(start: np.ndarray, end: np.ndarray) -> None:
    """E f(x) g(y) = E g(x) f(y) for draws x of a density, ``start`` (n, 2), and ends y of a kernel from there."""

    def shapes(t: np.ndarray) -> list[np.ndarray]:
        return [t[:, 0], t[:, 1], np.exp(t[:, 0]), t[:, 0] * t[:, 1], (t[:, 1] > 0.0).astype(float)]

    for i, (f_start, f_end) in enumerate(zip(shapes(start), shapes(end), strict=True)):
        for g_start, g_end in list(zip(shapes(start), shapes(end), strict=True))[:i]:
            difference = f_start * g_end - g_start * f_end
            assert abs(difference.mean()) < 4.0 * difference.std() / np.sqrt(len(start))
