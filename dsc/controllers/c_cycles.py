"""C text of a controller in cycles: the structs of sensors and motors, and the function `cycle`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dsc.controllers.c_functions import constant_text
from dsc.controllers.identifiers import by_name, identifiers
from dsc.controllers.model import Controller, Device
from dsc.controllers.runtime.tables import MAX_NOW

_HEAD = """int chart_cycle(struct chart *c, const struct chart_sensors *sensors, int64_t now_ns,
                struct chart_motors *motors)"""

_TIME = ("(!c->cycled || now_ns >= c->clock)", f"now_ns >= -INT64_C({MAX_NOW})", f"now_ns <= INT64_C({MAX_NOW})")
_FIRST = """        for (int timer = 0; timer < CHART_TIMERS && !c->cycled; timer++) {
            c->due[timer] += now_ns - c->clock;
        }
        c->clock = c->cycled ? c->clock : now_ns;
        c->cycled = true;""".splitlines()


def declare_cycle(controller: Controller) -> Iterator[str]:
    """Yield the declaration of the function `cycle`."""
    if controller.cycle:
        yield "/* Execute `step`, store the values of the sensors, fire `cycle`, and write the values of the motors."
        yield "   The timers of the initial states count from the first cycle. CHART_BUSY: there was no cycle."
        yield "   CHART_UNKNOWN: a sensor is out of range, or the time decreases, and nothing happens. */"
        yield f"{_HEAD};"


def define_cycle(controller: Controller) -> Iterator[str]:
    """Yield the function `cycle`."""
    if not controller.cycle:
        return
    data = by_name(controller.data)
    checks = [text for word, one in _words(controller.sensors) for text in _checks(f"sensors->{word}", one)]
    yield from ("", _HEAD, "{", "    int status = CHART_UNKNOWN;")
    if not controller.sensors:
        yield "    (void)sensors;"
    if not controller.motors:
        yield "    (void)motors;"
    yield f"    if ({' && '.join((*_TIME, *checks))}) {{"
    yield from _FIRST
    yield from ("        status = chart_step(c, now_ns);", "        if (!c->ended && !(status & CHART_BUSY)) {")
    yield f"            struct chart_occurrence cycle = chart_occurred({controller.cycle});"
    for (word, _), name in zip(_words(controller.sensors), controller.sensors, strict=True):
        yield f"            c->data.{data[name]} = sensors->{word};"
    yield from ("            chart_handle(c, &cycle);", "            status = c->status;", "        }", "    }")
    for (word, one), name in zip(_words(controller.motors), controller.motors, strict=True):
        yield f"    motors->{word} = c->ended ? {constant_text(one.start)} : {_clip(f'c->data.{data[name]}', one)};"
    yield from ("    return status;", "}")


def _words(devices: Mapping[str, Device]) -> list[tuple[str, Device]]:
    return [*zip(identifiers(devices), devices.values(), strict=True)]


def _checks(text: str, sensor: Device) -> Iterator[str]:
    if sensor.kind != "boolean":
        yield f"{text} >= {constant_text(sensor.least)} && {text} <= {constant_text(sensor.most)}"


def _clip(text: str, motor: Device) -> str:
    if motor.kind == "boolean":
        return text
    least, most = constant_text(motor.least), constant_text(motor.most)
    return f"{text} < {least} ? {least} : {text} > {most} ? {most} : {text}"
