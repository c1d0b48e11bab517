"""Pushed messages about an action: in order, each one time, without those that were lost."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dsc.sequencer.clock import run_simulated
from dsc.wire.action_news import MOST_AHEAD, ActionNews

PUSHES = st.lists(st.integers(1, 12), max_size=30)


@given(PUSHES)
def test_messages_arrive_in_order_each_one_time_up_to_a_gap(numbers):
    news, received = ActionNews("host"), 0
    for number in numbers:
        news.receive("host", {"n": number, "message": {"report": number}})
        for message in news.take_after(received):
            received += 1
            assert message == {"report": received}
    seen = set(numbers)
    assert received == next(number for number in range(13) if number + 1 not in seen)


def test_foreign_and_malformed_pushes_are_dropped():
    news = ActionNews("host")
    for sender, body in (
        ("other", {"n": 1, "message": {}}),
        ("host", {"n": "1", "message": {}}),
        ("host", 3),
        ("host", {"n": 1, "message": 2}),
    ):
        news.receive(sender, body)
    assert news.take_after(0) == []


def test_messages_behind_a_lost_one_are_bounded():
    news = ActionNews("host")
    for number in range(2, 10 * MOST_AHEAD):
        news.receive("host", {"n": number, "message": {}})
    assert news.take_after(0) == []
    assert len(news.take_after(1)) == MOST_AHEAD


def test_a_wait_ends_with_a_message_or_after_its_time():
    async def main():
        news = ActionNews("host")
        await news.wait(5.0)
        news.receive("host", {"n": 1, "message": {}})
        await news.wait(float("inf"))
        return news.take_after(0)

    assert run_simulated(main()) == [{}]
