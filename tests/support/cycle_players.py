"""The same cycles by `CycleController`, by a Python controller and by a C controller, each with a record of each cycle."""

from __future__ import annotations

from typing import Any, NamedTuple

from controller_players import BUSY, FAILED, QUEUE, RUNAWAY, SANITIZED, compile_players, run_players

from dsc import CycleController
from dsc.controllers.building import compile_controller
from dsc.controllers.python_text import python_text
from dsc.errors import RunawayError
from knowledge_base.errors import InputError


class Cycle(NamedTuple):
    """The state after one cycle."""

    status: int
    ended: bool
    active: tuple[str, ...]
    motors: dict[str, Any]


def play_engine(plot, cycles):
    """The records of `CycleController` up to the one that ends it; none if it fails at the start."""
    records: list[Cycle] = []
    try:
        robot = CycleController(plot)
    except (InputError, RunawayError):
        return records
    for now, sensors in cycles:
        status = 0
        try:
            robot.step(sensors, now / 1e9)
        except InputError:
            status = FAILED
        except RunawayError:
            status = RUNAWAY
        records.append(Cycle(status, robot.ended, tuple(robot.active), robot.motors))
    return records


def play_python(plot, cycles):
    """The records of the generated Python module, up to the first cycle that stays busy."""
    model, names = compile_controller(plot), dict[str, Any]()
    exec(compile(python_text(model, QUEUE), "controller.py", "exec"), names)  # noqa: S102  what is tested
    controller = names["Controller"]()
    controller.init(names["Host"](), 0)
    records = []
    for now, sensors in cycles:
        motors = controller.cycle(sensors, now)
        active = tuple(model.nodes[index].name for index in controller.configuration())
        records.append(Cycle(int(controller.status), controller.ended, active, motors))
        if controller.status & BUSY:
            break
    return records


def as_raised(records):
    """The records with one cause of an end each, as `CycleController` raises one error."""
    return [one._replace(status=RUNAWAY) if one.status & RUNAWAY else one for one in records]


DRIVER = r"""
static void chart_play(void)
{
    static struct chart c;
    static const struct chart_host host = {NULL, NULL, NULL, NULL, NULL};
    struct chart_sensors in;
    struct chart_motors out;
    long long now, steps, cycles;
    int bumper, states[CHART_NODES];
    chart_init(&c, &host, NULL, 0);
    if (scanf("%lld", &cycles) != 1) { abort(); }
    while (cycles-- > 0) {
        if (scanf("%lld %lf %d %lld", &now, &in.light, &bumper, &steps) != 4) { abort(); }
        in.bumper = bumper; in.steps = steps;
        const int status = chart_cycle(&c, &in, now, &out);
        printf("%d %d %.17g %lld %d", status, c.ended, out.wheel, (long long)out.gear, out.lamp);
        for (int i = 0, count = chart_configuration(&c, states); i < count; i++) { printf(" %d", states[i]); }
        printf("\n");
    }
}
"""


class CCycles:
    """The generated C files of several charts of `cycle_charts`, compiled to one program."""

    def __init__(self, folder, plots, cc="cc", flags=SANITIZED):
        self.models = [compile_controller(plot) for plot in plots]
        self.program = compile_players(folder, self.models, DRIVER, cc, flags)

    def play(self, plays):
        """The records of each play; a play is the number of its chart and its cycles."""
        text = "\n".join(f"{number}\n{len(cycles)}\n{''.join(map(_line, cycles))}" for number, cycles in plays)
        lines = iter(run_players(self.program, text))
        return [[self._record(self.models[number], next(lines)) for _ in cycles] for number, cycles in plays]

    @staticmethod
    def _record(model, line):
        status, ended, wheel, gear, lamp, *states = line.split(" ")
        motors = {"wheel": float(wheel), "gear": int(gear), "lamp": lamp == "1"}
        return Cycle(int(status), ended == "1", tuple(model.nodes[int(index)].name for index in states), motors)


def _line(cycle):
    now, sensors = cycle
    return f"{now} {sensors['light']!r} {int(sensors['bumper'])} {sensors['steps']}\n"
