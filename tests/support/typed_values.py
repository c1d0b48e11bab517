"""Random types of data, with values that have the type, and values that differ from it in one part."""

from __future__ import annotations

from hypothesis import strategies as st

RECORDS = {
    "spot": {"x": "number", "label": "optional text"},
    "find": {"item": "text", "at": "spot", "tags": "list of text"},
}
_numbers = st.integers(-(10**6), 10**6) | st.floats(-1e6, 1e6, allow_nan=False)
_texts = st.text("abc déf", max_size=6)
_spots = st.fixed_dictionaries({"x": _numbers}, optional={"label": _texts})
PLAIN = {
    "number": (_numbers, st.sampled_from(["x", True, None, [1], float("nan"), float("inf")])),
    "integer": (st.integers(-(10**9), 10**9), st.sampled_from([0.5, "1", False, None])),
    "boolean": (st.booleans(), st.sampled_from([0, 1, "true", None])),
    "text": (_texts, st.sampled_from([3, True, None, ["a"]])),
    "number from 0 to 5 in m": (st.integers(0, 5) | st.floats(0, 5), st.sampled_from([-0.1, 6, "3", None])),
    "left | right": (st.sampled_from(["left", "right"]), st.sampled_from(["middle", "", 1, None])),
    "1 | 2": (st.sampled_from([1, 2]), st.sampled_from([3, True, "1", None])),
    "geometry": (st.lists(_numbers, min_size=1, max_size=16), st.sampled_from([[], ["x"], 3, None, [0] * 17])),
    "spot": (_spots, st.sampled_from([{}, {"x": "a"}, {"x": 1, "y": 2}, {"x": 1, "label": 2}, "spot", None])),
    "find": (
        st.fixed_dictionaries({"item": _texts, "at": _spots, "tags": st.lists(_texts, max_size=3)}),
        st.sampled_from([{"item": "a", "at": {}, "tags": []}, {"item": "a", "at": {"x": 1}, "tags": [1]}, None]),
    ),
}


@st.composite
def typed_values(draw, *, fits):
    """Draw a type as text, and a value that has the type, or, with `fits=False`, a value that does not."""
    text = draw(st.sampled_from(sorted(PLAIN)))
    right, wrong = PLAIN[text]
    value = draw(right if fits else wrong)
    for _ in range(draw(st.integers(0, 3))):
        match draw(st.sampled_from(["list", "map", "optional"])):
            case "list":
                value = [*draw(st.lists(right, max_size=2)), value] if text in PLAIN else [value]
                text = f"list of {text}"
            case "map":
                value, text = {draw(_texts): value}, f"map of {text}"
            case _ if value is not None:  # `None` would fit
                text = f"optional {text}"
    return text, value
