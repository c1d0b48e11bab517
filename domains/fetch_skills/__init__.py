"""Skills of any robot that drives and grasps: a robot implements drivers, and uses the plots and planning actions."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
