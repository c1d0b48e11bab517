"""Drivers of all ready worlds: an object without a method, and a class instead of an object, are refused at once."""

import pytest

from domains.arm_skills.arm import Arm
from domains.arm_skills.kinematics import Chain
from domains.attention import Attention
from domains.dialogue.speech import Dialogue
from domains.fetch_skills.hand import Hand
from domains.fetch_skills.platform import PathPlanner, Platform
from knowledge_base.errors import InputError

PARTS = [
    (Platform, "drive"),
    (PathPlanner, "path"),
    (Hand, "grasp"),
    (Attention, "turn_to"),
    (Dialogue, "show"),
    (lambda driver: Arm(Chain(()), driver), "angles"),
]


@pytest.mark.parametrize(("part", "method"), PARTS)
def test_a_driver_without_a_method_is_refused(part, method):
    with pytest.raises(InputError, match=f"it has no method '{method}'"):
        part(object())


@pytest.mark.parametrize(("part", "method"), PARTS)
def test_a_class_as_a_driver_is_refused_with_the_remedy(part, method):
    kind = type("Mine", (), {method: lambda self: None})
    with pytest.raises(InputError, match=r"is an object, not a class; an instance is made by Mine\(\)"):
        part(kind)
