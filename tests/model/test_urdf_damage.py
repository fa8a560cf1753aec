"""Damaged URDF is refused in one message, or read as Pinocchio reads it."""

from __future__ import annotations

import re
from contextlib import suppress

import numpy as np
import pinocchio as pin
import pytest

from screwkin.algebra.se3 import as_array
from screwkin.errors import TableError
from screwkin.kinematics.positions import link_displacements
from screwkin.model.urdf_in import parse_urdf
from tests.model.as_pinocchio import configuration
from tests.model.urdf_texts import random_urdf


def assert_pinocchio_places_the_links_there(robot, text, rng):
    """In the zero pose and in a random one, if Pinocchio reads the text at all."""
    try:
        model = pin.buildModelFromXML(text)
    except (ValueError, RuntimeError):
        return
    data, n = model.createData(), len(robot.joints)
    for q in np.zeros(n), rng.uniform(-1, 1, n):
        displaced = link_displacements(robot, list(q))
        known = dict(zip(robot.joint_names, q, strict=True))
        pin.framesForwardKinematics(model, data, configuration(model, known))
        for link, D in zip(robot.links, displaced, strict=True):
            if model.existFrame(link.name, pin.FrameType.BODY):
                placed = data.oMf[model.getFrameId(link.name, pin.FrameType.BODY)].homogeneous
                scale = max(1, np.abs(placed).max())
                np.testing.assert_allclose(as_array(D @ link.frame), placed, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize(
    "seed", [*range(30), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(30, 500))]
)
def test_a_damaged_file_is_one_message_or_a_robot_that_stands_as_in_pinocchio(seed):
    """Characters changed, pieces cut and doubled, numbers and names replaced: never a traceback or a hang."""
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, 6)
    for _ in range(rng.integers(1, 5)):
        i, j = sorted(rng.integers(len(text), size=2))
        kind = rng.integers(6)
        if kind == 0:
            text = text[:i] + text[j:]
        elif kind == 1:
            text = text[:j] + text[i:]
        elif kind == 2:
            text = text[:i] + chr(rng.integers(1, 0x3000)) + text[i + 1 :]
        elif kind == 3:
            numbers = [found.span() for found in re.finditer(r"-?\d\.\d+", text)]
            if numbers:
                a, b = numbers[rng.integers(len(numbers))]
                text = text[:a] + rng.choice(["nan", "-inf", "1e400", "", "0", "1e30", "-1", "x"]) + text[b:]
        elif kind == 4:
            text = re.sub(f'"link{rng.integers(6)}"', f'"link{rng.integers(6)}"', text, count=1)
        else:
            text = text.replace(*rng.choice(["type", "axis", "xyz", "limit", "mass", "origin"], 2), 1)
        if not text:
            break
    with suppress(TableError):
        assert_pinocchio_places_the_links_there(parse_urdf(text).robot, text, rng)


def test_a_long_or_deep_file_takes_no_ages():
    deep = "<robot>" + "<link>" * 50_000 + "</link>" * 50_000 + "</robot>"
    for text in (deep, "<?xml " * 200_000, "<!-- -->" * 50_000 + "<robot>", "<robot " + " " * 10**6):
        with pytest.raises(TableError):
            parse_urdf(text)
