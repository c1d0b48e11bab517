"""Behaviour trees as XML files of BehaviorTree.CPP and Groot: reader, interpreter, writer, and skills (S4.7, S4.18)."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
