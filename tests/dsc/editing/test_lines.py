from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dsc.editing.lines import Lines, Spot

TEXTS = st.text(alphabet="a 🚪é:\n\r", max_size=40)


@given(TEXTS, st.data())
def test_each_offset_outside_of_a_line_end_comes_back(text, data):
    lines, offset = Lines(text), data.draw(st.integers(0, len(text)))
    inside_end = text[offset - 1 : offset + 1] == "\r\n"
    back = lines.offset(lines.spot(offset))
    assert back == (offset - 1 if inside_end else offset)


@given(TEXTS)
def test_columns_are_utf_16_units(text):
    lines = Lines(text)
    for offset in range(len(text) + 1):
        spot = lines.spot(offset)
        part = text[lines.start(spot.line) : offset]
        assert spot.column == len(part.encode("utf-16-le")) // 2


def test_an_emoji_has_two_columns_and_positions_outside_become_inside():
    lines = Lines("🚪 to: x\n  end")
    assert lines.offset(Spot(0, 3)) == 2
    assert lines.spot(2) == Spot(0, 3)
    assert lines.offset(Spot(0, 99)) == 7
    assert lines.offset(Spot(9, 0)) == 13
    assert lines.line(1) == "  end"
