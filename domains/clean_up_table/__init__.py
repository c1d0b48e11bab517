"""The ready world clean-up-table: the robot brings cups to the sink, and cans and crisp cans to the bin."""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
