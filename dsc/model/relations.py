"""The relations of a run and of its design, which conditions and queries read (S1.6, S1.13, S1.17)."""

from __future__ import annotations

from knowledge_base.language.checking.relations import declare_relations

DESIGN = {
    "dsc:plot": "plot",
    "dsc:state": "plot state",
    "dsc:uses": "plot part",
    "dsc:candidate": "plot state candidate",
    "dsc:offers": "plot offer",
    "dsc:when": "plot condition",
    "dsc:implements": "plot action",
    "dsc:emits": "plot event",
    "dsc:answers": "plot event rule",
    "dsc:concerns": "plot rule step",
    "dsc:leads-to": "plot rule next",
    "dsc:triggers": "plot skill",
    "dsc:touches": "plot component",
}
"""Relations of the design: names, each with its arguments.

The relations of rules and handlers have their labels. `dsc:touches` includes the components of all plots that a plot
uses, directly or indirectly.
"""
CONFIGURATION = {
    "dsc:active": "state",
    "dsc:running": "state plot",
    "dsc:step": "step action",
    "dsc:step-argument": "step parameter value",
}
"""Relations of the active states, by their paths; of the plots inside them; and of the steps of running plans."""
COMPONENTS = {
    "dsc:component": "component",
    "dsc:component-life": "component life",
    "dsc:component-mode": "component mode",
    "dsc:component-active": "component",
    "dsc:component-parameter": "component parameter value",
    "dsc:skill": "component skill",
    "dsc:outcome": "skill event",
    "dsc:wire": "port provider",
    "dsc:resource": "resource capacity",
    "dsc:occupies": "component resource amount",
    "dsc:executes": "state skill",
    "dsc:waits": "waiter awaited",
}
"""Relations of the components of a run: their life cycles, values, skills, wires and resources.

`dsc:executes` and `dsc:waits` have the states whose skills execute, or wait for a component. `dsc:waits` also has the
components that wait for resources.
"""
RELATIONS = {**DESIGN, **CONFIGURATION, **COMPONENTS}
declare_relations(RELATIONS)
