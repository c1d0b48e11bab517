"""Chance without a shared stream."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dsc.chance import choose, uniform


@given(seed=st.integers(), action_id=st.text(max_size=20), purpose=st.text(max_size=5))
def test_chance_is_a_function_of_its_arguments(seed, action_id, purpose):
    drawn = uniform(seed, action_id, purpose)
    assert 0.0 <= drawn < 1.0
    assert drawn == uniform(seed, action_id, purpose)
    assert choose(seed, action_id, purpose, "abc") in "abc"


def test_chance_is_even():
    draws = [uniform(0, f"a{n}", "fault") for n in range(4000)]
    assert 0.47 < sum(draws) / len(draws) < 0.53
    assert 700 < sum(draw < 0.2 for draw in draws) < 900
