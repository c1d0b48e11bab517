"""Controllers: the example of the page, refused forms, ends and limits."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from controller_players import CPlayers, EnginePlayer, PythonPlayer
from controller_times import LINE_FOLLOWER
from controllers_soak import compare
from dsc_charts import plot

from dsc.controllers import build_controller
from dsc.errors import PlotError
from dsc.text.plot_files import load_plot, parse_plot
from dsc.text.yaml import read_file
from knowledge_base.errors import UnknownNameError

CC = shutil.which("cc")
PAGE = Path(__file__).parents[3] / "docs" / "controllers.md"
COUNTER = """
    plot: counter
    parameters: {step: {type: integer, default: 1, most: 9000000000000000000}, limit: integer}
    variables: {sum: {type: integer, initial: 0}, half: {type: number, initial: 0}}
    receives: {add: {by: integer}, begin: }
    emits: {full: {sum: integer}}
    states:
      wait:
        on:
          add: {assign: {sum: (+ ?sum (* ?step ?event.by)), half: (/ ?event.by 2)}}
          begin: work
          error: {}
      work:
        entry: {trigger: arm.move, with: {to: ?half}, within: 2}
        on: {moved: wait, timed_out: over}
      over: {final: true, emit: full, with: {sum: ?sum}}
"""


class Log:
    """A host that notes what the controller does."""

    def __init__(self):
        self.said = []

    def start(self, activity, run, arguments):
        self.said.append(("start", activity, run, arguments))

    def stop(self, activity, run):
        self.said.append(("stop", activity, run))

    def command(self, command, arguments):
        self.said.append(("command", command, arguments))

    def emit(self, event, data):
        self.said.append(("emit", event, data))


def counter(queue=16, **parameters):
    module: dict[str, Any] = {"__name__": "counter"}
    exec(build_controller(plot(COUNTER), "python", queue), module)  # noqa: S102  what is tested
    names, controller, log = SimpleNamespace(**module), module["Controller"](), Log()
    status = controller.init(log, 0, **{"limit": 1, **parameters})
    return controller, names, log, status


def test_the_example_of_the_page_is_the_file_and_its_c_file_compiles(tmp_path):
    (shown,) = re.findall(r"^```yaml\n(.*?)^```", PAGE.read_text(), flags=re.MULTILINE | re.DOTALL)
    assert shown == read_file(LINE_FOLLOWER)
    if CC is None:
        pytest.skip("there is no C compiler `cc`")
    (tmp_path / "line_follower.c").write_text(build_controller(load_plot(LINE_FOLLOWER), "c99"))
    (tmp_path / "main.c").write_text(
        '#define LINE_FOLLOWER_INTERFACE\n#include "line_follower.c"\n#include <stdio.h>\n'
        "int main(void)\n{\n    struct line_follower c;\n    struct line_follower_host host = {0};\n"
        "    struct line_follower_attributes data = {0};\n    int states[LINE_FOLLOWER_NODES];\n"
        "    line_follower_init(&c, &host, NULL, 0);\n    data.has_left = data.has_right = true;\n    data.left = 1000;\n"
        "    line_follower_post(&c, LINE_FOLLOWER_EVENT_SENSED, &data);\n    line_follower_step(&c, 1);\n"
        "    line_follower_configuration(&c, states);\n"
        '    printf("%d %d", states[1] == LINE_FOLLOWER_STATE_TURN_RIGHT, (int)c.data.turns);\n    return 0;\n}\n'
    )
    flags = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
    command = [
        CC,
        *flags,
        "-o",
        str(tmp_path / "main"),
        *(str(tmp_path / one) for one in ("main.c", "line_follower.c")),
    ]
    subprocess.run(command, check=True, timeout=60)
    assert subprocess.check_output([tmp_path / "main"], text=True, timeout=60) == "1 1"


def test_an_integer_of_more_than_64_bits():
    controller, names, _, _ = counter(step=2**62)
    controller.post(names.Events.ADD, {"by": 1})
    assert controller.step(1) == names.Status.OK
    controller.post(names.Events.ADD, {"by": 1})
    assert controller.step(2) == names.Status.OVERFLOW
    assert (controller.data.sum, controller.ended) == (2**62, False)


def test_a_full_queue():
    controller, names, _, _ = counter(queue=2)
    found = [controller.post(names.Events.ADD, {"by": 1}) for _ in range(3)]
    assert found == [names.Status.OK, names.Status.OK, names.Status.FULL]
    controller.step(1)
    assert (controller.data.sum, controller.dropped) == (2, 1)


def test_an_activity_that_takes_too_long():
    controller, names, log, _ = counter()
    controller.post(names.Events.ADD, {"by": 3})
    controller.post(names.Events.BEGIN)
    controller.step(10)
    controller.step(2_000_000_009)
    assert log.said == [("start", 0, 1, {"to": 1.5})]
    controller.step(2_000_000_010)
    assert log.said[1:] == [("stop", 0, 1), ("emit", names.Events.FULL, {"sum": 3})]
    assert controller.ended


def test_an_outcome_that_nothing_handles():
    controller, names, _, _ = counter()
    controller.post(names.Events.BEGIN)
    controller.step(1)
    controller.end(1, names.Events.ADD)
    assert controller.step(2) == names.Status.FAILED
    assert controller.ended
    assert controller.post(names.Events.ADD) == names.Status.UNKNOWN


def test_parameters_out_of_range_and_events_of_the_controller():
    controller, names, _, status = counter(step=9_000_000_000_000_000_001)
    assert (status, controller.ended) == (names.Status.FAILED, True)
    controller, names, _, _ = counter()
    assert controller.post(names.Events.DONE) == names.Status.UNKNOWN
    with pytest.raises(ValueError, match="'by' is an integer"):
        controller.post(names.Events.ADD, {"by": 1.5})


@pytest.mark.parametrize(
    ("misuse", "said"),
    [
        (lambda new, _: new.init(Log()), "the parameter 'limit' has no default: pass it to `init`"),
        (lambda new, _: new.init(Log(), limit=5, nix=3), r"there is no parameter 'nix'; .* \['step', 'limit'\]"),
        (lambda new, _: new.init(Log(), 0.5, limit=5), "the time is an integer of nanoseconds"),
        (lambda new, _: new.step(0), "call `init` before"),
        (lambda new, _: new.post(3), "call `init` before"),
        (lambda _, begun: begun.step(0.5), "the time is an integer of nanoseconds"),
        (lambda _, begun: begun.post("add"), "an event is one of `Events`, not 'add'"),
        (lambda _, begun: begun.post(3, {"bye": 1}), r"there is no attribute 'bye'; the attributes are .*'by'"),
        (lambda _, begun: begun.post(3, {"by": "1"}), "'by' is an integer, not '1'"),
    ],
)
def test_misuse_of_a_generated_controller(misuse, said):
    begun, names, _, _ = counter()
    with pytest.raises(ValueError, match=said):
        misuse(names.Controller(), begun)


def test_refused_forms_together_with_their_lines():
    wrong = plot(
        """
        plot: wrong
        variables: {n: number, who: {type: text, initial: bob}}
        receives: {go: {times: integer}}
        states:
          a:
            entry: {trigger: base.drive, with: {to: shelf}}
            exit: {trigger: base.stop}
            on:
              go:
                - {to: b, when: (on cup table)}
                - {to: c, tell: (p)}
                - {to: b, when: (> ?event.time 1)}
          b: {use: other, on: {done: c}}
          d: {dynamic: [x, y], on: {done: c, no_candidate: c}}
          c: {final: true}
        """,
        "wrong.yaml",
    )
    with pytest.raises(PlotError) as caught:
        build_controller(wrong, "c99")
    found = [(one.place.line, one.text.partition(";")[0]) for one in caught.value.findings]
    assert {one.code for one in caught.value.findings} == {"controller"}
    assert [line for line, _ in found] == [3, 3, 7, 8, 11, 12, 13, 14, 15]
    assert "did you mean 'times'" in caught.value.findings[6].text
    assert found[4][1] == "'(on cup table)' is a condition on knowledge"


def test_other_mistakes_and_other_languages():
    with pytest.raises(PlotError, match="nowhere"):
        build_controller(plot("{plot: p, states: {a: {on: {e: nowhere}}}}"), "python")
    with pytest.raises(UnknownNameError, match="no target language 'c98'; did you mean 'c99'"):
        build_controller(plot(COUNTER), "c98")


@pytest.mark.skipif(CC is None, reason="there is no C compiler `cc`")
def test_names_that_are_words_of_the_languages(tmp_path):
    text = """
    plot: int
    variables: {for: {type: number, initial: 1}, a-b: {type: integer, initial: 2}, a_b: {type: integer, initial: 3}}
    receives: {e: {n: integer, z: number, b: boolean, while: number}}
    states: {a-b: {on: {e: {to: a_b, assign: {for: (+ ?for ?event.while)}}}}, a_b: {entry: {switch: x, to: "*/"}}}
    """
    odd = plot(text)
    player = EnginePlayer(odd)
    player.play([("e", 0, {"while": 2.0}, 0), ("step", 0, {}, 1)])
    python = [*PythonPlayer(odd).play(player.calls)]
    compare(player.records, python, "engine and Python")
    assert python[-1].active == ("a_b",)
    assert len(CPlayers(tmp_path, [odd], CC).play([(0, player.calls[1:])])[0]) == 2


@pytest.mark.parametrize("kind", ["shallow", "deep"])
def test_histories_and_clear(kind, tmp_path):
    chart = plot(f"""
        plot: player
        dialect: scxml
        receives: {{e: {{n: integer, z: number, b: boolean}}, f: , g: , leave: }}
        states:
          playing:
            initial: one
            states:
              h: {{history: {kind}, to: one}}
              one: {{states: {{slow: {{on: {{e: fast}}}}, fast: {{on: {{e: two}}}}}}}}
              two: {{states: {{low: {{on: {{e: high}}}}, high: {{}}}}}}
            on: {{leave: off}}
          off: {{on: {{f: h, g: {{to: h, clear: playing}}, leave: playing}}}}
    """)
    player = EnginePlayer(chart)
    names = "e leave f e e leave f leave g leave f"
    player.play([(name, 0, {}, now) for name in names.split() for name, now in ((name, 0), ("step", 1))])
    python = [*PythonPlayer(chart).play(player.calls)]
    compare(player.records, python, "engine and Python")
    assert [one.active[-1] for one in python[2::2]] == {
        "shallow": ["fast", "off", "slow", "fast", "low", "off", "low", "off", "slow", "off", "slow"],
        "deep": ["fast", "off", "fast", "low", "high", "off", "high", "off", "slow", "off", "slow"],
    }[kind]
    if CC is not None:
        compare(python, CPlayers(tmp_path, [chart], CC).play([(0, player.calls)])[0], "Python and C")


def test_parameters_with_the_names_of_other_parameters():
    plot = parse_plot(
        "plot: p\nparameters: {self: {type: integer, default: 1}, host: {type: integer, default: 1}, now_ns: {type: number, default: 1}}\n"
        "states: {a: {after: {seconds: 1, to: b}}, b: {final: true}}\n"
    )
    names: dict[str, Any] = {}
    exec(build_controller(plot, "python"), names)  # noqa: S102  the text is what is tested
    controller = names["Controller"]()
    controller.init(names["Host"](), now_ns=0, self_=2, host_=3, now_ns_=4.5)
    assert (controller.data.self_, controller.data.host_, controller.data.now_ns_) == (2, 3, 4.5)


@pytest.mark.parametrize("value", [2.5, "7", True, 10**30, None])
def test_a_parameter_of_another_kind_fails_the_start(value):
    names: dict[str, Any] = {}
    plot = parse_plot(
        "plot: p\nparameters: {count: {type: integer, default: 1}}\nstates: {a: {after: {seconds: 1, to: b}}, b: {final: true}}\n"
    )
    exec(build_controller(plot, "python"), names)  # noqa: S102  the text is what is tested
    controller = names["Controller"]()
    assert controller.init(names["Host"](), 0, count=value) & names["Status"].FAILED
    assert controller.ended
