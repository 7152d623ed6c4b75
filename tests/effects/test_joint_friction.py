"""Joints that stick before they slide, with a force of their own."""

import numpy as np
import pytest

from savgs_ident.effects.joint_friction import STRETCH, JointFriction

from .laws import follow, typical

JOINTS = JointFriction()
P = typical(JOINTS)
FORCE = float(P["joint_friction_force"])
STEP = 2e-4


def test_a_slow_pull_sticks_over_its_stretch_then_slides() -> None:
    pulled = 4e-4 * STEP * np.arange(5000)
    force = -follow(JOINTS, P, pulled, STEP, 0.0)
    sticking = (pulled > 0.1 * STRETCH) & (pulled < 0.8 * STRETCH)
    assert np.polyfit(pulled[sticking], force[sticking], 1)[0] == pytest.approx(FORCE / STRETCH, rel=0.01)
    assert force[pulled > 1.1 * STRETCH] == pytest.approx(FORCE, rel=1e-12)


@pytest.mark.parametrize("force", [20.0, 400.0])
def test_a_cycle_costs_the_work_of_sliding(force: float) -> None:
    """4 F (A - x_0) for an amplitude A, whatever the rate."""
    amplitude, period = 2e-3, 5.0
    phase = 2.0 * np.pi * np.arange(round(2.0 * period / STEP)) * STEP / period
    moved = amplitude * np.sin(phase)
    along = follow(JOINTS, typical(JOINTS, joint_friction_force=force), moved, STEP, 0.0)
    last = phase >= 2.0 * np.pi
    work = -np.sum(along[last] * np.gradient(moved)[last])
    assert work == pytest.approx(4.0 * force * (amplitude - STRETCH), rel=0.01)


def test_motions_within_its_stretch_do_not_slide() -> None:
    """The suspension is stiffer there and springs back."""
    moved = 0.3 * STRETCH * np.sin(2.0 * np.pi * 1.0 * STEP * np.arange(5000))
    force = follow(JOINTS, P, moved, STEP, 0.0)
    assert np.max(np.abs(force + FORCE / STRETCH * moved)) < 0.03 * FORCE
