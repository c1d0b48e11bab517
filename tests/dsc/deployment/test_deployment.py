"""Deployment models: placement, hardware, resources and deadlines are checked, explained and drawn."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest

from dsc.components.component import ALWAYS, Component
from dsc.components.demands import Demand, TimedTask
from dsc.deployment.checks import check_deployment
from dsc.deployment.cores import cores_of, verdict_of
from dsc.deployment.diagram import draw_deployment
from dsc.deployment.model import parse_deployment
from dsc.deployment.timeline import draw_worst_cases
from knowledge_base.errors import InputError

LAB = """
deployment: lab
platforms:
  small: {cores: 2, resources: {memory: 1000}}
  board: {scheduling: earliest_deadline}
hosts:
  base: {platform: small}
  arm: {platform: board}
devices:
  sick_front: {kind: laser, host: base}
  sick_rear: {kind: laser, host: base}
  radio: {kind: wlan, host: base, shared: true}
resources:
  memory: {unit: MB}
  speech: {exclusive: true}
components:
  front: {host: base, hardware: [laser, wlan], tasks: {scan: {period: 0.05, worst_case: 0.008}}}
  rear: {host: base, hardware: [sick_rear, wlan], tasks: {scan: {period: 0.05, worst_case: 0.008}}}
  mapper:
    resources: {memory: 200}
    modes:
      mapping: {resources: {memory: 500}, tasks: {fuse: {period: 0.2, worst_case: 0.05, core: 1}}}
      looking: {hardware: [radio], resources: {memory: 100}}
  servo: {host: arm, tasks: {step: {period: 0.01, worst_case: 0.004}, log: {period: 0.1, worst_case: 0.05}}}
groups:
  sight: {host: base, components: [mapper]}
modes:
  driving: {front: neutral, rear: neutral, mapper: mapping}
  grasping: {mapper: looking, servo: neutral}
"""


def changed(*replacements: tuple[str, str]):
    text = LAB
    for old, new in replacements:
        assert old in text, old
        text = text.replace(old, new)
    return parse_deployment(text, "lab.yaml")


def findings(*replacements: tuple[str, str]):
    return [str(one) for one in check_deployment(changed(*replacements))]


def test_a_deployment_that_fits_has_no_findings():
    assert findings() == []


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("{platform: board}", "{platform: bored}", 8, "there is no platform 'bored'; did you mean 'board'?"),
        ("components: [mapper]", "components: [maper]", 26, "there is no component 'maper'; did you mean 'mapper'?"),
        ("host: arm, ", "", 24, "component 'servo' has no host, and is in no group"),
        ("components: [mapper]", "components: [mapper, front]", 17, "has several hosts: base, group sight"),
        ("mapper: looking", "mapper: lookin", 29, "there is no mode of component 'mapper' with the name 'lookin'"),
        ("servo: neutral", "serwo: neutral", 29, "there is no component 'serwo'; did you mean 'servo'?"),
        ("kind: wlan, host: base", "kind: wlan, host: bas", 12, "there is no host 'bas'; did you mean 'base'?"),
        ("hardware: [laser", "hardware: [sick_rear", 18, "needs 'sick_rear' in mode 'driving', but 'front' uses 'sick_rear'; add a device"),
        ("hardware: [radio]", "hardware: [lidar]", 23, "but host 'base' has no such device; it has 'sick_front' (laser), 'sick_rear' (laser), 'radio' (wlan)"),
        ("step: {", "step: {core: 3, ", 24, "host 'arm' has no core 3; its last core is 0"),
        ("memory: 500", "memory: 900", 7, "host 'base' has 1000 MB of 'memory', but its components use 1100 MB (mapper 1100)"),
        ("resources: {memory: 1000}", "resources: {}", 7, "host 'base' has no resource 'memory', which 'mapper' uses"),
        ("scan: {period: 0.05, worst_case: 0.008}}}\n  rear", "scan: {priority: 1, period: 0.05, worst_case: 0.008}}}\n  rear", 18, "either all tasks on core 0 of host 'base' have a priority, or none"),
        ("worst_case: 0.05}", "worst_case: 0.07}", 8, "the tasks on core 0 of host 'arm' in mode 'grasping' need 110% of its time: servo.step 40%, servo.log 70%"),
    ],
)  # fmt: skip
def test_a_mistake_has_its_place_and_its_reason(old: str, new: str, line: int, said: str):
    found = findings((old, new))
    assert len(found) == 1 + ("maper" in new), found  # then its component has no host, too
    assert found[0].startswith(f"lab.yaml:{line}:"), found
    assert said in found[0]


def test_an_exclusive_resource_has_one_user():
    pair = ("resources: {memory: 200}", "resources: {memory: 200, speech: 1}"), ("radio]", "radio]")
    assert findings(*pair) == []
    both = findings(*pair, ("front: {host: base,", "front: {host: base, resources: {speech: 1},"))
    assert both == ["lab.yaml:7:3: host 'base' has one 'speech' for 'front' and 'mapper' in mode 'driving'"]


def test_a_late_task_is_explained():
    late = (
        "scan: {period: 0.05, worst_case: 0.008}}}\n  mapper",
        "scan: {period: 0.1, worst_case: 0.03, deadline: 0.035}}}\n  mapper",
    )
    urgent = (
        "front: {host: base, hardware: [laser, wlan], tasks: {scan: {period: 0.05, worst_case: 0.008}",
        "front: {host: base, hardware: [laser, wlan], tasks: {scan: {period: 0.03, worst_case: 0.008}",
    )
    (found,) = findings(late, urgent)
    assert "task 'rear.scan' may end 38 ms or more after its arrival behind front.scan" in found
    assert "its deadline is 35 ms" in found


def test_work_that_is_due_too_early_is_explained():
    (found,) = findings(
        ("log: {period: 0.1, worst_case: 0.05}", "log: {period: 0.1, worst_case: 0.02, deadline: 0.025}")
    )
    assert found == (
        "lab.yaml:8:3: 25 ms after all tasks on core 0 of host 'arm' in mode 'grasping' have arrived together,"
        " 28 ms of work are due: servo.step 8 ms, servo.log 20 ms"
    )


def test_tasks_without_priorities_are_urgent_by_their_deadlines():
    first, second = [core for core in cores_of(changed()) if core.host == "base"]
    assert [task.name for task in first.tasks] == ["front.scan", "rear.scan"]
    assert verdict_of(first).responses == {"front.scan": 8_000_000, "rear.scan": 16_000_000}
    assert verdict_of(first).within_bound
    assert [task.name for task in second.tasks] == ["mapper.fuse"]


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ("{period: 0.1, worst_case: 0.2}", "worst_case: the worst case of 0.2 s is longer than the period of 0.1 s"),
        ("{period: 1, worst_case: 0.2, deadline: 0.1}", "longer than the deadline of 0.1 s"),
        ("{period: 0, worst_case: 0.2}", "greater than or equal to 0.000001"),
        ("{period: 1, worst_cas: 0.2}", "did you mean 'worst_case'"),
    ],
)
def test_impossible_times_are_refused_in_files_and_classes(times: str, said: str):
    with pytest.raises(InputError) as in_file:
        changed(("{period: 0.2, worst_case: 0.05, core: 1}", times))
    assert said.removeprefix("worst_case: ") in str(in_file.value)
    data = {name: float(value) for name, value in (pair.split(": ") for pair in times.strip("{}").split(", "))}
    with pytest.raises(InputError) as in_class:
        type("Servo", (Component,), {"demands": {ALWAYS: {"tasks": {"step": data}}}, "__module__": __name__})
    assert said in str(in_class.value)
    assert "test_deployment.py" in str(in_class.value)


def test_a_class_declares_demands_as_values_or_as_data():
    class Servo(Component):
        demands: ClassVar[Any] = {
            ALWAYS: Demand(hardware=("gpio",), tasks={"step": TimedTask(period=0.01, worst_case=0.004)}),
            "moving": {"resources": {"power": 40}},
        }  # fmt: skip

    assert Servo.demands[ALWAYS].tasks["step"].due == 0.01
    assert Servo.demands["moving"] == Demand(resources={"power": 40})


def test_drawings_have_each_host_component_wire_and_task():
    deployment = changed()
    drawn = draw_deployment(deployment, {"mapper.scan": "rear.scan"})
    for text in ("base", "arm", "sick_front", "mapper", "memory 500 MB in mapping", "needs laser", "step: 0.004 s"):
        assert f">{text}" in drawn
    assert drawn.count('class="wire"') == 1
    timeline = draw_worst_cases(deployment)
    for text in ("front.scan", "mapper.fuse", "servo.log", "arm, core 0 in mode &#x27;grasping&#x27;: 90% of its time"):
        assert f">{text}" in timeline
    assert "#b3261e" not in timeline
    late = draw_worst_cases(changed(("worst_case: 0.05}", "worst_case: 0.07}")))
    assert "#b3261e" in late


def test_tasks_of_equal_names_in_several_modes_all_count():
    both = changed(
        ("looking: {hardware", "looking: {tasks: {fuse: {period: 0.1, worst_case: 0.09, core: 1}}, hardware"),
        (LAB[LAB.index("modes:\n  driving") :], ""),
    )
    (core,) = [one for one in cores_of(both) if one.number == 1]
    assert [task.name for task in core.tasks] == ["mapper.looking.fuse", "mapper.fuse"]
    (found,) = [str(one) for one in check_deployment(both) if one.code == "deployment-schedule"]
    assert found.endswith("need 115% of its time: mapper.looking.fuse 90%, mapper.fuse 25%")


def test_a_late_task_of_several_modes_has_its_place():
    both = changed(
        ("looking: {hardware", "looking: {tasks: {fuse: {period: 0.4, worst_case: 0.1, deadline: 0.12, core: 1}}, hardware"),
        ("fuse: {period: 0.2, worst_case: 0.05, core: 1}", "fuse: {period: 0.2, worst_case: 0.05, deadline: 0.1, core: 1}"),
        (LAB[LAB.index("modes:\n  driving") :], ""),
    )  # fmt: skip
    (found,) = [str(one) for one in check_deployment(both) if one.code == "deployment-schedule"]
    assert found.startswith("lab.yaml:23:")
    assert "'mapper.looking.fuse' may end 150 ms or more after its arrival behind mapper.fuse" in found
