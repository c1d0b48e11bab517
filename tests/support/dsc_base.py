"""A mobile base with a parameter for each role that may change one."""

from __future__ import annotations

from typing import ClassVar

from dsc import Component
from dsc.components.parameters import Parameter


class Base(Component):
    name = "base"
    declares: ClassVar = {
        "speed": Parameter("number", default=0.5, least=0.1, most=1.5),
        "mode": Parameter("text", default="calm", among=("calm", "brisk")),
        "port": Parameter("text", changed_by="profile"),
        "wheels": Parameter("number", default=4, changed_by="nobody"),
        "light": Parameter("boolean", default=False, changed_by="rules"),
        "cycle": Parameter("number", default=2.0, least=0),
    }
    relations = ("(<= ?speed (* 0.5 ?cycle))",)
