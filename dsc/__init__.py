"""State charts: what a plot is, how it runs, which plot is chosen and why."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base._lazy import lazy_exports

if TYPE_CHECKING:
    from dsc.blocking import BlockingCall as BlockingCall
    from dsc.calls import Ended as Ended
    from dsc.calls import Outcome as Outcome
    from dsc.calls import SkillCall as SkillCall
    from dsc.calls import Status as Status
    from dsc.chance import uniform as uniform
    from dsc.components.component import ALWAYS as ALWAYS
    from dsc.components.component import Component as Component
    from dsc.components.endpoint import Endpoint as Endpoint
    from dsc.components.factories import component_of as component_of
    from dsc.components.heartbeat import Heartbeat as Heartbeat
    from dsc.components.life_cycle import Life as Life
    from dsc.components.parameters import Parameter as Parameter
    from dsc.components.ports import event as event
    from dsc.components.ports import query as query
    from dsc.components.ports import takes as takes
    from dsc.components.remote import Host as Host
    from dsc.components.remote import RemoteComponent as RemoteComponent
    from dsc.components.streams import Push as Push
    from dsc.components.streams import Stream as Stream
    from dsc.components.transport import LocalTransport as LocalTransport
    from dsc.dynamic.library import Library as Library
    from dsc.engine.machine import Machine as Machine
    from dsc.errors import ChangedError as ChangedError
    from dsc.errors import PlotError as PlotError
    from dsc.errors import RunawayError as RunawayError
    from dsc.errors import UncertainActionError as UncertainActionError
    from dsc.events import Event as Event
    from dsc.model.plot import ActionPlot as ActionPlot
    from dsc.model.profile import Profile as Profile
    from dsc.primitive import primitive_plot as primitive_plot
    from dsc.profiles import configure as configure
    from dsc.reflection import MODELS as MODELS
    from dsc.reflection import design_facts as design_facts
    from dsc.runs.archive import has_run as has_run
    from dsc.runs.archive import is_unfinished as is_unfinished
    from dsc.runs.store import RunStore as RunStore
    from dsc.sequencer.clock import LoopClock as LoopClock
    from dsc.sequencer.clock import run_real as run_real
    from dsc.sequencer.clock import run_simulated as run_simulated
    from dsc.sequencer.replay import replay as replay
    from dsc.sequencer.sequencer import RunEnd as RunEnd
    from dsc.sequencer.sequencer import Sequencer as Sequencer
    from dsc.skills import skill as skill
    from dsc.text.cloning import cloned as cloned
    from dsc.text.cloning import cloned_profile as cloned_profile
    from dsc.text.plot_files import load_library as load_library
    from dsc.text.plot_files import load_plot as load_plot
    from dsc.text.plot_files import parse_plot as parse_plot
    from dsc.text.profile_files import find_profile as find_profile
    from dsc.text.profile_files import load_profile as load_profile
    from dsc.text.profile_files import parse_profile as parse_profile
    from dsc.trace import Record as Record
    from dsc.trace import Trace as Trace
    from dsc.validation import validate_library as validate_library
    from dsc.validation import validate_plot as validate_plot
    from dsc.validation.library import raise_findings as raise_findings
    from dsc.validation.review import review_plot as review_plot

__getattr__, __dir__, __all__ = lazy_exports(
    __name__,
    {
        "ALWAYS": "components.component",
        "ActionPlot": "model.plot",
        "BlockingCall": "blocking",
        "ChangedError": "errors",
        "Component": "components.component",
        "Ended": "calls",
        "Endpoint": "components.endpoint",
        "Event": "events",
        "Heartbeat": "components.heartbeat",
        "Host": "components.remote",
        "Library": "dynamic.library",
        "Life": "components.life_cycle",
        "LocalTransport": "components.transport",
        "LoopClock": "sequencer.clock",
        "MODELS": "reflection",
        "Machine": "engine.machine",
        "Outcome": "calls",
        "Parameter": "components.parameters",
        "PlotError": "errors",
        "Profile": "model.profile",
        "Push": "components.streams",
        "Record": "trace",
        "RemoteComponent": "components.remote",
        "RunEnd": "sequencer.sequencer",
        "RunStore": "runs.store",
        "RunawayError": "errors",
        "Sequencer": "sequencer.sequencer",
        "SkillCall": "calls",
        "Status": "calls",
        "Stream": "components.streams",
        "Trace": "trace",
        "UncertainActionError": "errors",
        "cloned": "text.cloning",
        "cloned_profile": "text.cloning",
        "component_of": "components.factories",
        "configure": "profiles",
        "design_facts": "reflection",
        "event": "components.ports",
        "find_profile": "text.profile_files",
        "has_run": "runs.archive",
        "is_unfinished": "runs.archive",
        "load_library": "text.plot_files",
        "load_plot": "text.plot_files",
        "load_profile": "text.profile_files",
        "parse_plot": "text.plot_files",
        "parse_profile": "text.profile_files",
        "primitive_plot": "primitive",
        "query": "components.ports",
        "raise_findings": "validation.library",
        "replay": "sequencer.replay",
        "review_plot": "validation.review",
        "run_real": "sequencer.clock",
        "run_simulated": "sequencer.clock",
        "skill": "skills",
        "takes": "components.ports",
        "uniform": "chance",
        "validate_library": "validation",
        "validate_plot": "validation",
    },
)
