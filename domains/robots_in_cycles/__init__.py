"""Two robots that plots drive in cycles in MuJoCo: a line follower and an obstacle avoider."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
