"""State charts: what a plot is, how it runs, which plot is chosen and why."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
