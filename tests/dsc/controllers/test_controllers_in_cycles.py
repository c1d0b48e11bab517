"""Controllers in cycles: the interpreter, the Python and the C controller set equal motors on random sensors."""

from __future__ import annotations

import random
import shutil
import subprocess
from typing import Any

import pytest

from dsc import CycleController
from dsc.controllers import build_controller
from dsc.model.plot import ActionPlot

CC = shutil.which("cc")
FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1")
CHARTS, CYCLES = 12, 150
GUARDS = (
    "(> ?light 0.5)", "(<= ?light 0.3)", "(= ?bumper true)", "(> ?steps 3)", "(in-state a1)", "(in-state b0)",
    "(and (in-state a0) (< ?wheel 1))", "(or (= ?lamp true) (> ?gear 2))", "(> ?light ?edge)",
)  # fmt: skip
VALUES: dict[str, tuple[Any, ...]] = {
    "wheel": ("?edge", "(* 4 ?light)", "(- ?wheel 1.5)", "(/ ?light (- ?steps 5))", -2),
    "gear": ("?steps", "(+ ?gear 1)", 1),
    "lamp": (True, False, "?bumper"),
}
MAIN = r"""
#include <stdio.h>
#include "robot.c"
int main(void)
{
    struct robot c;
    struct robot_host host = {0};
    struct robot_sensors in;
    struct robot_motors out;
    long long now, steps;
    int bumper;
    robot_init(&c, &host, NULL, 0);
    while (scanf("%lld %lf %d %lld", &now, &in.light, &bumper, &steps) == 4) {
        in.bumper = bumper; in.steps = steps;
        const int status = robot_cycle(&c, &in, now, &out);
        printf("%.17g %lld %d %d %d\n", out.wheel, (long long)out.gear, out.lamp, c.ended, status);
    }
    return 0;
}
"""


def grow(seed: int) -> ActionPlot:
    """A random chart of two regions, whose states form rings."""
    pick = random.Random(seed).choice  # noqa: S311

    def acts() -> dict[str, Any]:
        motor = pick(("wheel", "gear", "lamp"))
        return pick(({"assign": {motor: pick(VALUES[motor])}}, {"perform": pick(("rest", "go"))}))

    def way(to: str | None) -> dict[str, Any]:
        return {"when": pick(GUARDS), "do": [acts()], **({} if to is None else {"to": to})}

    def state(name: str, following: str) -> dict[str, Any]:
        form: dict[str, Any] = {"entry": acts(), "on": {"cycle": [way(None), way(following), way(name)], "error": {}}}
        if pick((True, False)):
            form["exit"] = acts()
        if pick((True, False)):
            form["after"] = {"seconds": pick((0.01, 0.05, 0.3)), "to": following}
        if pick((True, False)):
            form["every"] = {"seconds": pick((0.02, 0.07)), "do": [acts()]}
        return form

    rings = {ring: {f"{ring}{n}": state(f"{ring}{n}", f"{ring}{(n + 1) % 3}") for n in range(3)} for ring in "ab"}
    ends = {"to": "over", "when": "(> ?steps 98)"}
    states = {"all": {"regions": {ring: {"states": inside} for ring, inside in rings.items()}, "on": {"cycle": ends}}}
    return ActionPlot.model_validate({
        "plot": "robot", "states": {**states, "over": {"final": True}},
        "robot": {
            "sensors": {"light": "number from 0 to 1", "bumper": "boolean", "steps": "integer from 0 to 99"},
            "motors": {
                "wheel": "number from -3 to 3", "gear": {"type": "integer from 1 to 4", "initial": 2}, "lamp": "boolean",
            },
            "constants": {"edge": 0.4},
            "operations": {"rest": {"wheel": 0, "lamp": False}, "go": {"wheel": "(* 2 ?edge)", "gear": "(+ ?gear 1)"}},
        },
    })  # fmt: skip


def draw(seed: int) -> list[tuple[int, dict[str, Any]]]:
    """Times in nanoseconds and values of sensors."""
    chance, now, drawn = random.Random(seed), 0, []  # noqa: S311
    for _ in range(CYCLES):
        now += chance.choice((5, 16, 32, 32, 100)) * 1_000_000
        steps = 99 if chance.random() < 0.005 else chance.randrange(9)
        drawn.append((now, {"light": round(chance.random(), 3), "bumper": chance.random() < 0.3, "steps": steps}))
    return drawn


def interpreted(chart, cycles):
    robot = CycleController(chart)
    return [(robot.step(sensors, now / 1e9), robot.ended) for now, sensors in cycles]


def python_controller(chart):
    names: dict[str, Any] = {}
    exec(build_controller(chart, "python"), names)  # noqa: S102  what is tested
    controller = names["Controller"]()
    controller.init(names["Host"](), 0)
    return controller, names


@pytest.mark.parametrize("seed", range(CHARTS))
def test_random_charts_in_cycles_by_all_players(seed, tmp_path):
    chart, cycles = grow(seed), draw(seed)
    expected = interpreted(chart, cycles)
    controller, _ = python_controller(chart)
    found = [(controller.cycle(sensors, now), controller.ended) for now, sensors in cycles]
    assert found == expected
    assert len({str(motors) for motors, _ in expected}) > 1
    if CC is None or seed % 3:
        return
    (tmp_path / "robot.c").write_text(build_controller(chart, "c99"))
    (tmp_path / "main.c").write_text(MAIN)
    subprocess.run([CC, *FLAGS, "-o", "main", "main.c"], check=True, timeout=120, cwd=tmp_path)
    lines = [f"{now} {one['light']!r} {int(one['bumper'])} {one['steps']}" for now, one in cycles]
    said = subprocess.check_output([tmp_path / "main"], input="\n".join(lines), text=True, timeout=60)
    of_c = []
    for line in said.splitlines():
        wheel, gear, lamp, ended, status = line.split()
        of_c.append(({"wheel": float(wheel), "gear": int(gear), "lamp": lamp == "1"}, ended == "1"))
        assert status == "0"
    assert of_c == expected


def test_wrong_values_of_sensors_of_a_generated_controller():
    controller, names = python_controller(grow(1))
    good = {"light": 0.5, "bumper": False, "steps": 1}
    for wrong in ({"light": 2}, {"light": True}, {"steps": 1.5}, {"bumper": 1}, {"light": None}, {"lite": 1}):
        with pytest.raises(ValueError, match=r"'light'|'steps'|'bumper'"):
            controller.cycle({**good, **wrong}, 5)
    for wrong in (None, [("light", 1)]):
        with pytest.raises(ValueError, match="a map by name"):
            controller.cycle(wrong, 5)
    for wrong in (None, 0.5, True, 2**63):
        with pytest.raises(ValueError, match="an integer of nanoseconds"):
            controller.cycle(good, wrong)
    assert controller.post(names["Events"].CYCLE) == names["Status"].UNKNOWN
    assert controller.cycle(good, 5).keys() == {"wheel", "gear", "lamp"}
    with pytest.raises(ValueError, match="does not decrease: 4 follows 5"):
        controller.cycle(good, 4)
