"""Planning: from a goal to a plan, from a plan to an action plot, and to a new plan when the world changes."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
