"""Planning: plans for goals, action plots for plans, and new plans when the world changes."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
