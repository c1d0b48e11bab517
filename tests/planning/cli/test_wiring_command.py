"""`dsc wiring`: required ports of a robot with their providers, as text and as JSON; a port without one is an error."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from planning.cli.command import app

ROBOT = """
from dsc import Component, Push, Stream
from planning import Bundle, PlanningDomain


class Laser(Component):
    scan = Push({"metres": "number"})
    heat = Push({"celsius": "number"})


class Mapper(Component):
    name = "mapper"
    scan = Stream({"metres": "number"})
    heat = Stream({"celsius": "number"}, "front.heat")


def bundle():
    return Bundle("lasers", components=lambda: [Laser("front"), Laser("rear"), Mapper()], goal="(mapped)",
                  domain=PlanningDomain.parse("(define (domain d) (:predicates (mapped)))"))
"""


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "lasers.py").write_text(ROBOT)
    (tmp_path / "rear.yaml").write_text("profile: rear\nwiring: {mapper.scan: rear.scan}\n")
    (tmp_path / "wrong.yaml").write_text("profile: wrong\nwiring:\n  mapper.scam: rear.scan\n")
    return tmp_path


def dsc(*arguments):
    return CliRunner().invoke(app, [*map(str, arguments)])


def test_a_wire_is_listed_with_what_has_chosen_it(robot):
    done = dsc("wiring", f"{robot / 'lasers.py'}:bundle", "--profile", robot / "rear.yaml", "--json")
    assert done.exit_code == 0, done.output
    wires = {one["port"]: (one["provider"], one["by"]) for one in json.loads(done.output)}
    assert wires == {"mapper.heat": ("front.heat", "component"), "mapper.scan": ("rear.scan", "profile")}
    text = dsc("wiring", f"{robot / 'lasers.py'}:bundle", "--profile", robot / "rear.yaml").output
    assert "rear.scan" in text


def test_an_ambiguous_port_is_listed_with_the_candidates(robot):
    done = dsc("wiring", f"{robot / 'lasers.py'}:bundle")
    assert done.exit_code == 2
    assert "several services fit port 'mapper.scan': front.scan, rear.scan" in done.output


def test_a_robot_without_required_ports_says_so():
    assert "require no ports" in dsc("wiring", "clean-up-table").output


def test_a_profile_with_an_unknown_port_names_its_line(robot):
    done = dsc("wiring", f"{robot / 'lasers.py'}:bundle", "--profile", robot / "wrong.yaml")
    assert "no required port 'mapper.scam'; did you mean 'mapper.scan'" in str(done.exception)
    assert "wrong.yaml:3" in str(done.exception)
