"""Tools for tests of plots: rehearsals, substitutes, predicates over steps, coverage, faults, crashes and invariants.

No other package of the project imports this one.
"""

from knowledge_base._lazy import lazy_exports

__getattr__, __dir__, __all__ = lazy_exports(__name__, __file__)
