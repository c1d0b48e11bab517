"""The time of a step of the line follower: by the engine, by its Python controller and by its C controller."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path
from typing import Any

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.events import Event
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

LINE_FOLLOWER = Path(__file__).parents[2] / "examples" / "controllers" / "line_follower.yaml"
SENSED = ({"left": 900.0, "right": 900.0}, {"left": 1000.0, "right": 900.0}, {"left": 900.0, "right": 1000.0})
"""What the sensors measure in turn; the robot drives on, turns, and drives straight again."""
STEPS, C_STEPS = 9_000, 900_000
MAIN = """#include <stdio.h>
#include <time.h>
#include "line_follower.c"

int main(void)
{
    static struct line_follower c;
    static const double left[3] = {900.0, 1000.0, 900.0}, right[3] = {900.0, 900.0, 1000.0};
    const struct line_follower_host host = {NULL, NULL, NULL, NULL, NULL};
    const clock_t began = clock();
    line_follower_init(&c, &host, NULL, 0);
    for (long i = 0; i < @STEPS@; i++) {
        struct line_follower_attributes data;
        memset(&data, 0, sizeof data);
        data.has_left = data.has_right = true;
        data.left = left[i % 3];
        data.right = right[i % 3];
        line_follower_post(&c, LINE_FOLLOWER_EVENT_SENSED, &data);
        line_follower_step(&c, i);
    }
    printf("%ld %.9f\\n", (long)c.data.turns, (double)(clock() - began) / CLOCKS_PER_SEC / @STEPS@);
    return 0;
}
"""


def time_engine(plot):
    """Seconds of a step."""
    library, knowledge = Library([plot]), KnowledgeBase(Schema())
    machine = Machine(library)
    machine.start(plot.name, {}, KnowledgeSituation(knowledge, library))
    began = time.process_time()
    for number in range(STEPS):
        machine.send(Event("sensed", SENSED[number % 3]), KnowledgeSituation(knowledge, library))
    assert machine.state.root.variables["turns"] == STEPS // 3
    return (time.process_time() - began) / STEPS


def time_python(text):
    """Seconds of a step."""
    module: dict[str, Any] = {"__name__": "line_follower"}
    exec(compile(text, "line_follower.py", "exec"), module)  # noqa: S102  what is measured
    controller, event = module["Controller"](), module["Events"].SENSED
    controller.init(module["Host"]())
    began = time.process_time()
    for number in range(STEPS):
        controller.post(event, SENSED[number % 3])
        controller.step(number)
    assert controller.data.turns == STEPS // 3
    return (time.process_time() - began) / STEPS


def time_c(folder, text, cc):
    """Seconds of a step."""
    (folder / "line_follower.c").write_text(text, encoding="utf-8")
    (folder / "main.c").write_text(MAIN.replace("@STEPS@", str(C_STEPS)), encoding="utf-8")
    flags = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2")
    subprocess.run([cc, *flags, "-o", str(folder / "main"), str(folder / "main.c")], check=True, timeout=120)
    done = subprocess.run([folder / "main"], check=True, capture_output=True, text=True, timeout=120)
    turns, seconds = done.stdout.split()
    assert int(turns) == C_STEPS // 3
    return float(seconds)
