"""A stance of plain numbers, so that plans are tested without a robot table."""

from __future__ import annotations

import pytest

from screwkin.gait.stance import LEFT, RIGHT, Foot, Hand, Stance

SOLE = ((0.052, 0.033), (-0.052, 0.033), (-0.052, -0.033), (0.052, -0.033))


@pytest.fixture
def stance():
    feet = (Foot("right_foot", RIGHT, SOLE), Foot("left_foot", LEFT, SOLE))
    hands = (
        Hand("right_hand", RIGHT, (0.0, -0.064646, 0.121451)),
        Hand("left_hand", LEFT, (0.0, 0.064646, 0.121451)),
    )
    return Stance(0.042165, feet, hands)
