"""Checks and review of the robot section: its parts set motors, and the outermost plot drives a robot (S3.3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dsc.data_types import data_type
from dsc.errors import Finding
from dsc.events import CYCLE
from dsc.model.actions import Assign, OfRobot, Perform
from dsc.model.language import first_key
from dsc.model.plot import Path
from dsc.model.robot import RobotSection
from dsc.model.states import State
from dsc.validation.subject import Subject
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import Arithmetic, Constant, Term, Variable
from knowledge_base.language.syntax.text import to_text


def check_robot(subject: Subject) -> Iterator[Finding]:
    """Yield findings about the robot section of a plot, about its use, and about robot sections of used plots."""
    robot = subject.plot.robot
    for path, name in subject.plot.references():
        if name in subject.library and subject.library.plot(name).robot is not None:
            message = f"the plot '{name}' has a robot section, and only the outermost plot drives a robot"
            yield subject.finding(path, "robot", message, "give it values as parameters", found=name)
    yield from _check_operations(subject)
    if robot is None:
        return
    if CYCLE in subject.plot.receives:
        message = "`robot` declares the event 'cycle'"
        yield subject.finding(("receives", CYCLE), "robot", message, "give this event another name", found=CYCLE)
    for path, _, way in subject.ways():
        if CYCLE in way.emitted:
            message = "only the program that drives the robot fires 'cycle'"
            yield subject.finding((*path, "emit"), "robot", message, "give this event another name", found=CYCLE)
    yield from _check_devices(subject, robot)


def sets_motors(subject: Subject, action: object) -> bool:
    """Return whether an action sets only motors; entry and exit may contain such an action."""
    motors = {} if subject.plot.robot is None else subject.plot.robot.motors
    return isinstance(action, OfRobot) or (isinstance(action, Assign) and action.assign.keys() <= motors.keys())


def review_motors(subject: Subject) -> Iterator[Finding]:
    """Yield a warning for each value of an integer motor that may be a fraction, such as a quotient."""
    robot = subject.plot.robot
    if robot is None:
        return
    whole = {name for name, motor in robot.motors.items() if motor.kind.kind == "integer"}
    for path, values in _assignments(subject, robot):
        for name, term in values.items():
            if name in whole and _may_be_fraction(term, subject, robot):
                message = f"'{name}' is an integer, and {to_text(term)} may be a fraction, which is an `error`"
                fix = f"declare the motor '{name}' as a number, or compute with integers"
                yield subject.finding((*path, name), "robot", message, fix, found=to_text(term), level="warning")


def _assignments(subject: Subject, robot: RobotSection) -> Iterator[tuple[Path, Mapping[str, Term]]]:
    """Yield the values that operations, activities, states and transitions assign, with their paths."""
    for place, values in robot.assignments.items():
        yield ("robot", *place), values
    for path, action, _ in subject.actions():
        if isinstance(action, Assign):
            yield (*path, "assign"), action.assign
    for path, _, way in subject.ways():
        yield (*path, "assign"), way.assign
        for number, action in enumerate(way.do):
            if isinstance(action, Assign):
                yield (*path, "do", number, "assign"), action.assign


def _may_be_fraction(term: Term, subject: Subject, robot: RobotSection) -> bool:
    match term:
        case Constant(bool() | int() | float() as value):
            return value % 1 != 0
        case Variable(name) if name in robot.constants:
            return robot.constants[name] % 1 != 0
        case Variable(name):
            return data_type(subject.types.get(name) or "integer").kind == "number"
        case Arithmetic(operator, args):
            return operator == "/" or any(_may_be_fraction(one, subject, robot) for one in args)
        case _:
            return False


def _check_operations(subject: Subject) -> Iterator[Finding]:
    """Yield findings about actions with an unknown operation or activity."""
    states = [(state, path) for _, state, path in subject.states if isinstance(state, State)]
    blocks = [((*path, key), block) for state, path in states for key, block in state.blocks()]
    for path, actions in (*blocks, *(((*path, "do"), way.do) for path, _, way in subject.ways())):
        for number, action in enumerate(actions):
            if isinstance(action, OfRobot):
                try:
                    subject.plot.motor_values(action)
                except InputError as error:
                    group = "operations" if isinstance(action, Perform) else "activities"
                    fix = f"declare it under `{group}` of `robot`"
                    yield subject.caught(error, (*path, number, first_key(type(action))), "robot", fix)


def _check_devices(subject: Subject, robot: RobotSection) -> Iterator[Finding]:
    for group, devices in (("sensors", robot.sensors), ("motors", robot.motors)):
        for name, device in devices.items():
            try:
                device.kind.check(f"'{name}'", device.start)
            except InputError as error:
                yield subject.caught(error, ("robot", group, name, "initial"), "robot")
    for place, values in robot.assignments.items():
        for name in values.keys() - robot.motors.keys():
            message, path = f"'{name}' is no motor, and {_SETTERS[place[0]]} sets motors", ("robot", *place, name)
            yield subject.finding(path, "robot", message, "declare it under `motors`", found=name, valid=robot.motors)


_SETTERS = {"operations": "an operation", "activities": "an activity"}
