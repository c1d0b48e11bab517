"""Plot files: what people may write, and one clear message with file and line for what they may not."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsc_charts import plot

from dsc.text.plot_files import load_library, load_plot, parse_plot, plot_to_yaml
from dsc.text.yaml import MAX_BYTES, load_document
from knowledge_base.errors import InputError, ParseError, Place
from knowledge_base.language.syntax.expression import Variable

SHIPPED = sorted((Path(__file__).parents[3] / "domains").glob("*/plots/*.yaml"))


def test_variables_stand_in_braces_without_quotes():
    made = parse_plot("plot: p\nstates:\n  s: {use: q, with: {table: ?table, b: ?b}}")
    assert made.states["s"].arguments == {"table": Variable("table"), "b": Variable("b")}


def test_variables_stand_in_lists_and_blocks_too():
    assert load_document("[?a, ?b, {c: ?c}]").data == ["?a", "?b", {"c": "?c"}]
    assert load_document("- ?a\n- b: ?c").data == ["?a", {"b": "?c"}]
    assert load_document("? key\n: value").data == {"key": "value"}


def test_words_that_older_yaml_takes_for_truth_values_are_words():
    made = plot("{plot: p, states: {s: {on: {yes: off}}, off: {}}}")
    assert made.states["s"].on["yes"][0].target == "off"


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm():
    assert parse_plot("\ufeffplot: p\r\nstates:\r\n  s: {}\r\n").name == "p"


def test_every_part_knows_where_it_was_written():
    made = parse_plot("plot: p\nstates:\n  s:\n    on:\n      e: {to: s}\n    entry: {switch: a, to: b}\n", "f.yaml")
    assert made.place(("states", "s")) == Place("f.yaml", 3, 3)
    assert made.place(("states", "s", "on", "e", "to")) == Place("f.yaml", 5, 11)
    # A list of one may be written without the list; what is not written is where it would belong.
    assert made.place(("states", "s", "entry", 0, "to")) == Place("f.yaml", 6, 24)
    assert made.place(("states", "s", "exit", 0, "to")) == Place("f.yaml", 3, 3)


HEAD = "plot: p\nstates:\n  s:\n"
END = "\nstates: {s: {}}"
BROKEN = [
    # the plot
    ("", 1, "a mapping of keys was expected"),
    ("just text", 1, "a mapping of keys was expected"),
    ("- a\n- list", 1, "a mapping of keys was expected"),
    ("plot: p\ncolour: red" + END, 2, "unknown key 'colour'"),
    ("plot: p\nstate: {s: {}}", 2, "did you mean 'states'?"),
    ("states: {s: {}}", 1, "the key 'plot' is missing"),
    ("plot: two words" + END, 1, "two words"),
    ("plot: p", 1, "the key 'states' is missing"),
    ("plot: p\nstates: {}", 2, "at least one"),
    ("plot: p\nstates: [a, b]", 2, "a mapping of names was expected"),
    ("plot: p\nparameters: {a: }" + END, 2, "a mapping was expected"),
    ("plot: p\nparameters: {a: {typ: item}}" + END, 2, "did you mean 'type'?"),
    ("plot: p\nvariables:\n  n:\n    type: number\n    inital: 0" + END, 5, "did you mean 'initial'?"),
    ("plot: p\nemits: [failed]" + END, 2, "a mapping of names was expected"),
    ("plot: p\nemits:\n  failed: {reason: 5}" + END, 3, "text was expected; found 5"),
    ("plot: p\neffects: asumed" + END, 2, "'observed' or 'assumed'"),
    ("plot: p\nconfirm: later" + END, 2, "number"),
    ("plot: p\nconfirm: .inf" + END, 2, "finite"),
    ("plot: p\nwhen: (or" + END, 2, "'(' is never closed"),
    ("plot: p\n1: 5" + END, 2, "a key is a name; '1' is none"),
    ("plot: p\nparameters:\n  Item: item" + END, 3, "'Item' is not a name for a variable"),
    ("plot: p\nvariables:\n  two words: item" + END, 3, "'two words' is not a name for a variable"),
    ("plot: p\nemits:\n  failed:\n    itemName: item" + END, 4, "'itemName' is not a name for a variable"),
    (
        "plot: p\nparameters: {n: number}\nvariables:\n  n: number" + END,
        4,
        "'n' is declared twice: as parameter and as variable",
    ),
    # states
    ("plot: p\nstates:\n  s: text", 3, "a mapping was expected"),
    ("plot: p\nstates:\n  a/b: {}", 3, "'a/b' is not a name for a state"),
    (HEAD + "    states:\n      t:\n        states:\n          s: {}", 7, "two states are named 's'"),
    (HEAD + "    onn: {e: s}", 4, "did you mean 'on'?"),
    (HEAD + "    usee: q", 4, "did you mean 'use'?"),
    (HEAD + "    use: q\n    dynamic: [r]", 5, "unknown key 'dynamic'"),
    (HEAD + "    use: q\n    wiht: {a: 1}", 5, "did you mean 'with'?"),
    (HEAD + "    use: q\n    with:\n      a: [1, null]", 6, "a value was expected"),
    (HEAD + "    use: q\n    with:\n      a:", 6, "a value was expected"),
    (HEAD + "    use: q\n    with:\n      a: .nan", 6, "a finite number"),
    (HEAD + "    dynamic: q", 4, "a list was expected"),
    (HEAD + "    goal: (p\n", 4, "'(' is never closed"),
    (HEAD + "    goal: (p)\n    budget:\n      replan: 3", 6, "did you mean 'replans'?"),
    (HEAD + "    regions:\n      left:\n        state: {a: {}}", 6, "did you mean 'states'?"),
    (HEAD + "    regions:\n      left: {}", 5, "the key 'states' is missing"),
    (HEAD + "    final: true\n    on: {e: s}", 5, "unknown key 'on'"),
    (HEAD + "    final: perhaps", 4, "perhaps"),
    (HEAD + "    final: false", 4, "it should be true; found false"),
    # transitions
    (HEAD + "    on: [e]", 4, "a mapping of names was expected"),
    (HEAD + "    on:\n      e:", 5, "a mapping was expected"),
    (HEAD + "    on:\n      e: 5", 5, "a mapping was expected"),
    (HEAD + "    on:\n      e: {too: s}", 5, "did you mean 'to'?"),
    (HEAD + "    on:\n      e:\n        - s\n        - {to: s, whenn: (p)}", 7, "did you mean 'when'?"),
    (HEAD + "    on:\n      e: {to: s, when: (p}", 5, "'(' is never closed"),
    (HEAD + "    on:\n      e: {to: s, when: (and p q)}", 5, "column 6 of the text"),
    (HEAD + "    on:\n      e: {to: s, when: 5}", 5, "a condition was expected"),
    (HEAD + "    on:\n      e: {tell: (not)}", 5, "'not' is written"),
    (HEAD + "    on:\n      e: {tell: 5}", 5, "an effect was expected"),
    (HEAD + "    on:\n      e:\n        do:\n          - {asign: {n: 1}}", 7, "did you mean 'assign'?"),
    (HEAD + "    on:\n      e:\n        do:\n          - assign:\n              n: (+ ?n", 8, "'(' is never closed"),
    (HEAD + "    after: {second: 5, to: s}", 4, "did you mean 'seconds'?"),
    (HEAD + "    every: {second: 5, to: s}", 4, "did you mean 'seconds'?"),
    (
        HEAD + "    every:\n      - {seconds: 1, to: s}\n      - {to: s, seconds: 0}",
        6,
        "longer than 0 seconds; found 0",
    ),
    (HEAD + "    at_least: soon", 4, "a number of seconds was expected; found 'soon'"),
    (HEAD + "    at_leest: 1", 4, "did you mean 'at_least'?"),
    (HEAD + "    on_brake: {switch: arm, to: up}", 4, "did you mean 'on_break'?"),
    (HEAD + "    on:\n      e: {to: s, pas: {a: 1}}", 5, "did you mean 'pass'?"),
    (HEAD + "    on:\n      e: {to: s, cleer: s}", 5, "did you mean 'clear'?"),
    (HEAD + "    choce: [s]", 4, "did you mean 'choice'?"),
    (HEAD + "    choice: []", 4, "at least one entry is needed; found an empty list"),
    (HEAD + "    choice:\n      - {when: (p), to: s}\n      - {wen: (p), to: s}", 6, "did you mean 'when'?"),
    (HEAD + "    choice:\n      - {when: (p), too: s}\n      - s", 5, "did you mean 'to'?"),
    (HEAD + "    choice:\n      - s\n      - {when: (p)}", 6, "nothing rests in a connector"),
    (HEAD + "    selct: ?x\n    cases: {a: s}", 4, "did you mean 'select'?"),
    (HEAD + "    select: ?x\n    casses: {a: s}\n    else: s", 5, "did you mean 'cases'?"),
    (HEAD + "    select: ?x\n    cases: {a: s}", 3, "the key 'else' is missing"),
    (
        HEAD + "    select: ?x\n    cases:\n      a: s\n      b: {emit: e}\n    else: s",
        7,
        "nothing rests in a connector",
    ),
    (HEAD + "    select: ?x\n    cases:\n      1: {to: s, wen: (p)}\n    else: s", 6, "did you mean 'when'?"),
    (HEAD + "    select: ?x\n    cases: {1: s, '1': s}\n    else: s", 5, "two cases have the same value"),
    (HEAD + "    select: ?x\n    cases: {null: s}\n    else: s", 5, "a key is a name"),
    ("plot: p\noutputs:\n  n:\n    type: number\n    inital: 0" + END, 5, "did you mean 'initial'?"),
    (
        "plot: p\nparameters: {n: number}\noutputs:\n  n: number" + END,
        4,
        "'n' is declared twice: as parameter and as output",
    ),
    (
        "plot: p\nvariables: {n: number}\noutputs:\n  n: number" + END,
        4,
        "'n' is declared twice: as variable and as output",
    ),
    (HEAD + "    after: {to: s}", 4, "the key 'seconds' is missing"),
    (HEAD + "    after: 5", 4, "a mapping was expected"),
    (HEAD + "    after: {seconds: soon, to: s}", 4, "a number of seconds was expected"),
    (HEAD + "    after: {seconds: -1, to: s}", 4, "a number of seconds was expected"),
    # external actions
    (HEAD + "    entry: arm.pick", 4, "one of the keys trigger, set, switch"),
    (HEAD + "    entry: {triger: arm.pick}", 4, "did you mean 'trigger'?"),
    (HEAD + "    entry: {trigger: pick}", 4, "found 'pick'"),
    (HEAD + "    entry:\n      trigger: arm.pick\n      wiht: {a: 1}", 6, "did you mean 'with'?"),
    (HEAD + "    entry:\n      - trigger: arm.pick\n        within: soon", 6, "number"),
    (HEAD + "    entry:\n      - trigger: arm.pick\n        within: -1", 6, "greater than 0"),
    (HEAD + "    entry: {set: arm.approach}", 4, "the key 'to' is missing"),
    (HEAD + "    exit:\n      - {switch: arm}", 5, "the key 'to' is missing"),
    # rules
    ("plot: p\nrules:\n  - {on: e, then: retry}" + END, 3, "unknown key 'then'"),
    ("plot: p\nrules:\n  - on: e\n    do: {than: retry}" + END, 4, "did you mean 'then'?"),
    ("plot: p\nrules:\n  - on: e\n    do:\n      limit: 0" + END, 5, "greater than or equal to 1"),
    ("plot: p\nrules: {on: e, do: {then: retry}}" + END, 2, "a list was expected"),
    # YAML itself
    ("plot: p\nplot: q" + END, 2, 'duplicate key "plot"'),
    ("plot: p\nstates: {s: {}, s: {}}", 2, 'duplicate key "s"'),
    ("plot: !!str p" + END, 1, "tags are not used here"),
    ("plot: p\nstates: {s: !python/object {}}", 2, "tags are not used here"),
    ("plot: p\nstates: {s: &a {}, t: *a}", 2, "anchors and aliases are not used here"),
    ("plot: p\nstates: {s: *a}", 2, "anchors and aliases are not used here"),
    ("plot: p\n<<: {a: b}" + END, 2, "merge keys are not used here"),
    ("plot: p\n? [a, b]\n: 5" + END, 2, "a key is a name"),
    ("plot: p\nnull: 5" + END, 2, "a key is a name"),
    (HEAD + "    on:\n      : s", 5, "a key is a name"),
    ("plot: p\nstates: {s: {}\nrules: []", 3, "not readable as YAML"),
    ("plot: p\n\tstates: {}", 2, "not readable as YAML"),
    ("plot: p\nstates:\n  s: {}\n t: {}", 4, "not readable as YAML"),
    ("plot: 'p\nstates: {}", 2, "not readable as YAML"),
    ("plot: p\nstates: @s", 2, "not readable as YAML"),
    ("plot: p\nstates: {s: \x00}", 2, "not readable as YAML"),
    ("---\nplot: p\nstates: {s: {}}\n---\nplot: q", 4, "another document"),
    ("plot: p\nstates: " + "[" * 100_000, 2, "nested deeper than 128 levels"),
    ("plot: p\nstates: " + "{a: " * 10_000, 2, "nested deeper than 128 levels"),
    ("plot: p\nstates:\n" + "".join("  " * i + "-\n" for i in range(1, 200)), 130, "nested deeper than 128 levels"),
]


@pytest.mark.parametrize(("text", "line", "message"), BROKEN)
def test_a_broken_plot_gets_one_clear_error(text, line, message):
    with pytest.raises(InputError) as caught:
        parse_plot(text, "kitchen.yaml")
    said = str(caught.value)
    assert message in said
    assert said.startswith(f"kitchen.yaml:{line}:")
    assert "\n" not in said
    assert caught.value.place is not None
    assert caught.value.place.line == line


def test_a_duplicate_key_does_not_print_what_it_holds():
    text = "plot: p\nstates:\n" + "".join(f"  s{i}: {{}}\n" for i in range(100)) + "states: {}"
    with pytest.raises(ParseError) as caught:
        parse_plot(text)
    assert len(str(caught.value)) < 100


def test_a_text_too_large_is_refused_unread():
    with pytest.raises(InputError, match="250001 bytes; at most 250000"):
        parse_plot("#" * (MAX_BYTES + 1))


def test_a_file_too_large_is_refused_unread(tmp_path):
    file = tmp_path / "huge.yaml"
    file.write_bytes(b"#" * (MAX_BYTES + 1))
    with pytest.raises(InputError, match="250001 bytes; at most 250000") as caught:
        load_plot(file)
    assert caught.value.place == Place(str(file))


def test_a_file_that_is_not_there_has_a_neighbour_that_is(tmp_path):
    (tmp_path / "kitchen.yaml").write_text("plot: p")
    with pytest.raises(InputError, match=r"there is no file .*did you mean '.*kitchen\.yaml'"):
        load_plot(tmp_path / "kitchn.yaml")


def test_a_binary_file_and_a_folder_are_refused(tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"plot: p\nabout: \xff\xfe")
    with pytest.raises(InputError, match="byte 0xff") as caught:
        load_plot(tmp_path / "binary.yaml")
    assert caught.value.place == Place(str(tmp_path / "binary.yaml"), 2, 8)
    with pytest.raises(InputError, match="cannot read"):
        load_plot(tmp_path)


def test_a_folder_is_a_library_in_order_of_file_names(tmp_path):
    (tmp_path / "b.yaml").write_text("{plot: second, states: {s: {}}}")
    (tmp_path / "a.yaml").write_text("{plot: first, states: {s: {}}}")
    assert [p.name for p in load_library(tmp_path)] == ["first", "second"]


def test_two_plots_of_one_name_and_an_empty_folder_are_refused(tmp_path):
    with pytest.raises(InputError, match="there are no plots"):
        load_library(tmp_path)
    (tmp_path / "a.yaml").write_text("{plot: p, states: {s: {}}}")
    (tmp_path / "b.yaml").write_text("{plot: p, states: {s: {}}}")
    assert len(list(load_library(tmp_path))) == 1  # the same plot twice is one plot
    (tmp_path / "b.yaml").write_text("{plot: p, states: {t: {}}}")
    with pytest.raises(InputError, match="two different plots are named 'p'") as caught:
        load_library(tmp_path)
    assert caught.value.place == Place(str(tmp_path / "b.yaml"), 1, 2)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_shipped_plots_survive_reading_and_writing(file):
    made = load_plot(file)
    assert parse_plot(plot_to_yaml(made)) == made
