"""State charts: what a plot is, how it runs, which plot is chosen and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from dsc.calls import Outcome as Outcome
    from dsc.calls import SkillCall as SkillCall
    from dsc.components.component import Component as Component
    from dsc.components.factories import component_of as component_of
    from dsc.components.ports import event as event
    from dsc.components.ports import query as query
    from dsc.components.ports import takes as takes
    from dsc.components.streams import Push as Push
    from dsc.components.streams import Stream as Stream
    from dsc.dynamic.library import Library as Library
    from dsc.engine.machine import Machine as Machine
    from dsc.events import Event as Event
    from dsc.model.plot import ActionPlot as ActionPlot
    from dsc.primitive import primitive_plot as primitive_plot
    from dsc.sequencer.sequencer import RunEnd as RunEnd
    from dsc.sequencer.sequencer import Sequencer as Sequencer
    from dsc.skills import skill as skill
    from dsc.text.plot_files import load_library as load_library
    from dsc.text.plot_files import load_plot as load_plot
    from dsc.text.plot_files import parse_plot as parse_plot
    from dsc.trace import Record as Record
    from dsc.validation import validate_library as validate_library
    from dsc.validation import validate_plot as validate_plot

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "ActionPlot": "model.plot",
        "Component": "components.component",
        "Event": "events",
        "Library": "dynamic.library",
        "Machine": "engine.machine",
        "Outcome": "calls",
        "Push": "components.streams",
        "Record": "trace",
        "RunEnd": "sequencer.sequencer",
        "Sequencer": "sequencer.sequencer",
        "SkillCall": "calls",
        "Stream": "components.streams",
        "component_of": "components.factories",
        "event": "components.ports",
        "load_library": "text.plot_files",
        "load_plot": "text.plot_files",
        "parse_plot": "text.plot_files",
        "primitive_plot": "primitive",
        "query": "components.ports",
        "skill": "skills",
        "takes": "components.ports",
        "validate_library": "validation",
        "validate_plot": "validation",
    },
)
