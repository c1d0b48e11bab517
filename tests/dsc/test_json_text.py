"""The text is what the encoder writes."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc.json_text import text_by

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.tuples(inner) | st.dictionaries(st.text() | st.integers() | st.booleans(), inner),
)


ENCODERS = [json.JSONEncoder(ensure_ascii=False), json.JSONEncoder(separators=(",", ":"))]


@pytest.mark.parametrize("encoder", ENCODERS)
@given(value=PLAIN)
def test_it_is_what_the_encoder_writes(encoder, value):
    assert text_by(encoder)(value) == encoder.encode(value)


def test_what_is_no_number_of_json_is_written_as_python_reads_it():
    assert json.loads(text_by(ENCODERS[0])([math.inf, -math.inf])) == [math.inf, -math.inf]


def test_what_is_no_plain_data_is_refused():
    with pytest.raises(TypeError, match="not JSON serializable"):
        text_by(ENCODERS[0])({"a": object()})
