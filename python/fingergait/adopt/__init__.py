"""From a stranger's model to a turning object: which grasps a hand has, how far they turn, and what forbids the others.

`Adoption` has the stages from a model's file to a bundle; calling this module, `fg.adopt(...)`, does them all.
`search_grasps` is the grasp search alone; `view` says what it needs of a hand, `options` what is asked of a grasp.
"""

import sys
from types import ModuleType
from typing import Any

from fingergait.adopt.family import ObjectSpec
from fingergait.adopt.grasp import Found, Grasp
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.picture import write_map
from fingergait.adopt.pipeline import Adoption, adopt
from fingergait.adopt.search import search_object
from fingergait.adopt.survey import GraspSearch, objects_for, search_grasps
from fingergait.adopt.view import Coupling, FingerView, HandView, view_of

__all__ = [
    "Adoption",
    "Coupling",
    "FingerView",
    "Found",
    "Grasp",
    "GraspSearch",
    "HandView",
    "ObjectSpec",
    "SearchOptions",
    "adopt",
    "objects_for",
    "search_grasps",
    "search_object",
    "view_of",
    "write_map",
]


class _Callable(ModuleType):
    """So that `fg.adopt(...)` adopts a hand and `fg.adopt.search_grasps` is still to be found."""

    def __call__(self, *arguments: Any, **more: Any) -> Adoption:
        return adopt(*arguments, **more)


sys.modules[__name__].__class__ = _Callable
