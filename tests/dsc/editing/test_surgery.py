"""Edits of a plot's text keep its comments and style; an edit whose result is not the meant plot is refused."""

from __future__ import annotations

import pytest

from dsc.editing.surgery import Add, Edit, Move, Remove, RenameState, RenameVariable, Replace, apply, differences, patch
from knowledge_base.errors import InputError

TEXT = """\
# The head.
plot: fetch
parameters: {item: thing, place: room}   # both needed
states:
  # First the way.
  go:
    entry: {trigger: base.drive, with: {to: ?place}}
    on: {arrived: take, stuck: over}
  take:
    entry:
      - {set: arm.approach, to: side}   # not from above
      - {trigger: arm.take, with: {item: '?item'}}
    on:
      taken:
        to: over
        when: (and (in-state take) (holds ?item))
      lost: {to: go, when: (exists (?other - thing) (near ?other ?item))}
  over: {final: true}
rules:
  - on: slipped
    do: {then: go}
"""
EDITS: dict[str, tuple[Edit, str, str]] = {
    "a state, before another": (
        Add(("states", "look"), {"entry": {"trigger": "eye.look"}, "on": {"seen": "take"}}, before="take"),
        "    on: {arrived: take, stuck: over}\n",
        "    on: {arrived: take, stuck: over}\n  look:\n    entry: {trigger: eye.look}\n    on: {seen: take}\n",
    ),
    "a transition in brackets": (
        Add(("states", "go", "on", "lost"), "go"), "stuck: over}", "stuck: over, lost: go}",
    ),
    "a transition beside the only one": (
        Add(("states", "go", "on", "stuck", 0), {"to": "take", "when": "(near)"}),
        "stuck: over}", "stuck: [{to: take, when: (near)}, over]}",
    ),
    "a guard": (
        Add(("states", "go", "on", "stuck", 0, "when"), "(near)"), "stuck: over}", "stuck: {to: over, when: (near)}}",
    ),
    "the first exit": (
        Add(("states", "take", "exit", 0), {"switch": "arm", "to": "neutral"}),
        "?other ?item))}\n", "?other ?item))}\n    exit: {switch: arm, to: neutral}\n",
    ),
    "a group of keys in its usual place": (
        Add(("emits", "gone"), None), "# both needed\n", "# both needed\nemits: {gone: null}\n",
    ),
    "an action removed": (Remove(("states", "take", "entry", 0)), "      - {set: arm.approach, to: side}   # not from above\n", ""),
    "the only rule removed": (Remove(("rules", 0)), "rules:\n  - on: slipped\n    do: {then: go}\n", "rules: []\n"),
    "a target": (Replace(("states", "take", "on", "taken", 0, "to"), "go"), "        to: over\n", "        to: go\n"),
    "a parameter in its conditions": (
        RenameVariable(("parameters", "place"), "goal"),
        "{item: thing, place: room}   # both needed\nstates:\n  # First the way.\n  go:\n    entry: {trigger: base.drive, with: {to: ?place}}",
        "{item: thing, goal: room}   # both needed\nstates:\n  # First the way.\n  go:\n    entry: {trigger: base.drive, with: {to: ?goal}}",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", EDITS)
def test_the_text_after_an_edit(case):
    edit, before, after = EDITS[case]
    text = apply(TEXT, edit)
    assert text == TEXT.replace(before, after)
    assert patch(text, differences(text, TEXT)) == TEXT


def test_a_state_renamed_in_targets_rules_and_conditions():
    text = apply(apply(TEXT, RenameState(("states", "take"), "pick")), RenameState(("states", "go"), "drive"))
    assert text == TEXT.replace("arrived: take", "arrived: pick").replace("  take:", "  pick:").replace(
        "in-state take", "in-state pick"
    ).replace("  go:", "  drive:").replace("to: go", "to: drive").replace("then: go", "then: drive")


def test_a_state_moved_into_another_with_its_comments():
    text = apply(TEXT, Add(("states", "work", "states", "idle"), {"final": True}))
    text = apply(text, Move(("states", "take"), ("states", "work", "states", "take"), before="idle"))
    assert (
        "  work:\n    states:\n      take:\n        entry:\n          - {set: arm.approach, to: side}   # not from above\n"
        in text
    )


COMMENTED = """\
plot: tour
states:
  # Apart.

  # The way,
  # in two lines.
  go:   # by day
    # Inside.
    on: {arrived: over}   # at last
    # The end of the way.
  # No state is below.

  # The end.
  over: {final: true}
"""
WAY = COMMENTED[COMMENTED.index("  # The way,") : COMMENTED.index("  # No state")]


def test_a_removed_state_takes_the_comments_directly_above_and_at_its_lines():
    text = apply(COMMENTED, Add(("states", "stay"), {"final": True}, before="go"))
    assert text == COMMENTED.replace(WAY, "  stay: {final: true}\n" + WAY)
    assert apply(text, Remove(("states", "go"))) == text.replace(WAY, "")


def test_a_moved_state_takes_the_comments_directly_above_and_at_its_lines():
    text = apply(COMMENTED, Move(("states", "over"), ("states", "over"), before="go"))
    end = "  # The end.\n  over: {final: true}\n"
    assert text == COMMENTED.replace(end, "").replace(WAY, end + WAY)
    text = apply(COMMENTED, Add(("states", "work"), {"entry": {"send": "a.b"}, "states": {"idle": {"final": True}}}))
    inner = apply(text, Move(("states", "go"), ("states", "work", "states", "go")))
    assert "".join(f"    {line}" for line in WAY.splitlines(keepends=True)) in inner


def test_the_only_part_of_a_mapping_with_its_comments():
    text = "plot: a\nemits:\n  # Apart.\n\n  # Gone.\n  gone: {}   # too\nstates: {b: {final: true}}\n"
    assert apply(text, Remove(("emits", "gone"))) == text.replace("emits:", "emits: {}").replace(
        "  # Gone.\n  gone: {}   # too\n", ""
    )


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (RenameState(("states", "go"), "over"), "there is a state 'over' already"),
        (RenameVariable(("parameters", "item"), "other"), "or a place that would mean it"),
        (RenameState(("states", "go"), "true"), "a key is a name"),
        (Remove(("states", "tak")), "did you mean 'take'"),
        (Add(("states", "go"), {"final": True}), "there is a part 'go' already"),
        (Add(("states", "go", "color"), "red"), "unknown key 'color'"),
        (Replace(("states", "take", "entry", 0), {"sett": "arm.approach"}), "sett"),
        (Remove(("plot",)), "plot"),
        (Move(("states", "take", "entry", 0), ("states", "go", "entry", 0)), "no place inside brackets"),
        (Move(("states", "go"), ("states", "over", "states", "go")), "no place inside brackets"),
    ],
)
def test_a_refused_edit(edit, said):
    with pytest.raises(InputError, match=said):
        apply(TEXT, edit)


def test_a_motor_and_a_sensor_renamed_in_operations_and_transitions():
    text = """\
plot: p
robot:
  sensors: {light: number}
  motors: {wheel: number}
  operations: {go: {wheel: ?light}}
states:
  a: {entry: {assign: {wheel: 1}}, on: {cycle: {when: (> ?light 1), do: [{perform: go}]}}}
"""
    renamed = apply(text, RenameVariable(("robot", "motors", "wheel"), "left"))
    renamed = apply(renamed, RenameVariable(("robot", "sensors", "light"), "lux"))
    assert renamed == text.replace("wheel", "left").replace("light", "lux")
