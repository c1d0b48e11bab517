"""A mobile base with a parameter for each role that may change one."""

from __future__ import annotations

from typing import Literal

from dsc import Component, Parameters, parameter


class BaseParameters(Parameters):
    speed: float = parameter(0.5, least=0.1, most=1.5)
    mode: Literal["calm", "brisk"] = "calm"
    port: str = parameter(changed_by="profile")
    wheels: int = parameter(4, changed_by="nobody")
    light: bool = parameter(False, changed_by="rules")  # the default
    cycle: float = parameter(2.0, least=0)
    relations = ("(<= ?speed (* 0.5 ?cycle))",)


class Base(Component):
    name = "base"
    parameters: BaseParameters
