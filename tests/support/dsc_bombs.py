"""Plots and charts that are too deep, too many or too long: within the limit of bytes, and small to write down."""

from __future__ import annotations

from dsc.text.yaml import MAX_PARTS

HEAD = "plot: p\nstates:\n"
XML = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0">\n'
FINAL = "  over: {final: true}\n"


def nested(count):
    return "".join("  " * (2 * n + 1) + f"s{n}:\n" + "  " * (2 * n + 2) + "states:\n" for n in range(count))


def flow(count):
    return "states: " + "{a: {states: " * count + "{}" + "}}" * count


BOMBS = {
    "states_nested.yaml": (HEAD + nested(200), 130, "nested deeper than 128 levels"),
    "states_nested_in_braces.yaml": ("plot: p\n" + flow(10_000), 2, "nested deeper than 128 levels"),
    "brackets.yaml": (HEAD + "  a: " + "[" * 10_000, 3, "nested deeper than 128 levels"),
    "brackets_closed.yaml": (HEAD + "  a: " + "[" * 10_000 + "]" * 10_000, 3, "nested deeper than 128 levels"),
    "braces.yaml": ("{" * 100_000, 1, "nested deeper than 128 levels"),
    "dashes.yaml": ("- " * 50_000, 1, "nested deeper than 128 levels"),
    "questions.yaml": ("? " * 50_000, 1, "a key is a name"),
    "colons.yaml": (": " * 50_000, 1, "a key is a name"),
    "commas.yaml": ("plot: [" + "," * 100_000, 1, "no value begins with ','"),
    "open_text.yaml": ('plot: "' + "a " * 100_000, 1, "a quote is never closed"),
    "parentheses.yaml": (HEAD + "  a:\n    on:\n      done: {when: " + "(" * 10_000 + "}", 5, "nested more than 100 deep"),
    "negations.yaml": (HEAD + '  a: {goal: "' + "(not " * 10_000 + "(p)" + ")" * 10_000 + '"}', 3, "nested more than 100 deep"),
    "sums.yaml": (HEAD + '  a: {use: q, with: {n: "' + "(+ 1 " * 10_000 + "1" + ")" * 10_000 + '"}}', 3, "nested more than 100 deep"),
    "duplicates.yaml": (HEAD + "  s: {}\n" * 20_000, 4, "duplicate key"),
    "duplicates_at_the_end.yaml": (HEAD + "".join(f"  s{n}: {{}}\n" for n in range(4_000)) + "  s0: {}\n", 4003, "duplicate key"),
    "parts.yaml": (HEAD + "".join(f"  s{n}: {{}}\n" for n in range(15_000)), 9_000, f"more than {MAX_PARTS} keys and values"),
    "comments.yaml": ("#\n" * 100_000 + "plot: [", 100_001, "no value begins with the end of the text"),
    "name_of_plot.yaml": ("plot: " + "a b" * 50_000 + "\nstates: {s: {final: true}}", 1, "is not of the form expected here"),
    "name_of_key.yaml": (f"plot: p\n? {'k' * 100_000}\n: 3\nstates: {{s: }}", 2, "unknown key 'kkk"),
    "name_of_target.yaml": (HEAD + f"  a: {{on: {{done: {'o' * 100_000}}}}}\n  ? {'o' * 99_999}\n  : {{final: true}}", 3, "there is no state 'ooo"),
    "many_unknown_targets.yaml": (
        HEAD + "".join(f"  state_{n}: {{on: {{done: state_{n}x}}}}\n" for n in range(1_500)), 3, "did you mean 'state_0'?",
    ),
    "all_unreachable.yaml": (HEAD + FINAL + "".join(f"  s{n}: {{on: {{done: over}}}}\n" for n in range(1_500)), 4, "nothing leads"),
    "elements_nested.scxml": (XML + "<state>" * 10_000 + "</state>" * 10_000 + "</scxml>", 2, "nested deeper than 30 levels"),
    "elements_nested_and_open.scxml": (XML + "<state>" * 30_000, 2, "nested deeper than 30 levels"),
    "laughs.scxml": (
        '<!DOCTYPE lolz [<!ENTITY l0 "lol">' + "".join(f"<!ENTITY l{n} '" + f"&l{n - 1};" * 10 + "'>" for n in range(1, 10)) + "]>\n" + XML,
        1, "a document type",
    ),
    "laughs.yaml": (
        "a0: &a0 [lol]\n" + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 9)), 1, "anchors and aliases",
    ),
    "brackets_in_expression.scxml": (
        f'{XML}<state id="a"><transition event="e" cond="{"(" * 10_000}"/></state></scxml>', 2, "nested too deeply",
    ),
    "long_sum.scxml": (
        f'{XML}<datamodel><data id="x" expr="{"1+" * 10_000}1"/></datamodel><state id="a"/></scxml>', 2, "more than 100 operations",
    ),
    "tower_of_powers.scxml": (
        f'{XML}<datamodel><data id="x" expr="{"Math.pow(" * 20}2{",8)" * 20}"/></datamodel><state id="a"/></scxml>', 2, "more than 100 operations",
    ),
    "attributes.scxml": (XML + "<state " + " ".join(f"a{n}=''" for n in range(10_000)) + "/></scxml>", 2, "has no attribute 'a0'"),
    "many_unknown_targets.scxml": (
        XML + "".join(f'<state id="s{n}"><transition event="e" target="s{n}x"/></state>\n' for n in range(3_000)) + "</scxml>",
        2, "did you mean 's0'?",
    ),
    "many_exclusive_targets.scxml": (
        XML + "".join(f'<state id="s{n}"><transition event="e" target="s{n} s{n + 1}"/></state>\n' for n in range(2_000))
        + '<state id="s2000"/></scxml>', 2, "exclude each other",
    ),
    "many_turns.scxml": (
        XML + '<state id="a">' + '<transition event="e"/><transition event="f"/>' * 2_500 + '\n<transition event="e" target="b"/></state></scxml>',
        3, "there is no state 'b'",
    ),
    "many_rules.yaml": (
        "plot: p\nstates:\n" + "".join(f"  s{n}: {{goal: (p), on: {{done: s{n + 1}}}}}\n" for n in range(300)) + "  s300: {final: true}\nrules:\n"
        + "".join("  - {on: no_plan, when: (q), do: {then: retry}}\n" for n in range(300)), 304, "the rules would make 90000 transitions; at most 1000",
    ),
    "many_circles.yaml": (
        "plot: p\nstates:\n" + "".join(f"  s{n}: {{use: p, on: {{done: s{n + 1}}}}}\n" for n in range(1_400)) + "  s1400: {final: true}\n",
        3, "in a cycle: p -> p",
    ),
    "many_variables.yaml": (
        "plot: p\nvariables: {" + ", ".join(f"v{n}: number" for n in range(1_000)) + "}\nstates:\n"
        + "".join(f"  s{n}: {{on: {{done: {{to: s{n + 1}, assign: {{w{n}: ?v{n}}}}}}}}}\n" for n in range(700)) + "  s700: {final: true}\n",
        4, "there is no variable 'w0'",
    ),
    "many_free_variables.yaml": (
        "plot: p\nwhen: (and " + " ".join(f"(p ?v{n})" for n in range(10_000)) + ")\nstates: {a: {final: true}}\n",
        2, "the variable '?v0' is not bound",
    ),
    "elements_and_open.scxml": (XML + "<log/>\n" * 25_000, 25_002, "not readable as XML"),
}  # fmt: skip
"""Name of a file -> its text, the line of the fault, and what is said about it."""
