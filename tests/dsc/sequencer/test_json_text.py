"""The text says what the standard library's would."""

import json
import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dsc.trace import text_of

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: (
        st.lists(inner) | st.tuples(inner) | st.dictionaries(st.text() | st.integers() | st.booleans(), inner)
    ),
)


def deep(levels):
    return [] if not levels else [deep(levels - 1)]


@given(value=PLAIN)
@example("half a character: \ud800")
@example(deep(300))
@example([1, 1.0, True, -0.0, 1e-7, 2**80])
def test_it_reads_as_what_the_standard_library_writes(value):
    text = text_of(value)
    assert repr(json.loads(text)) == repr(json.loads(json.dumps(value)))
    assert "\n" not in text


def test_an_infinite_number_is_written_as_python_reads_it():
    assert json.loads(text_of([math.inf, -math.inf])) == [math.inf, -math.inf]


def test_a_value_that_is_not_plain_data_is_refused():
    with pytest.raises(TypeError, match="not JSON serializable"):
        text_of({"a": object()})
