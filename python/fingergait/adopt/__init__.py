"""From a stranger's model to a turning object: which grasps a hand has, how far they turn, and what forbids the others.

`search_grasps` is the entry; `view` says what it needs of a hand, `options` what is asked of a grasp.
"""

from fingergait.adopt.family import ObjectSpec
from fingergait.adopt.grasp import Found, Grasp
from fingergait.adopt.options import SearchOptions
from fingergait.adopt.picture import write_map
from fingergait.adopt.search import search_object
from fingergait.adopt.survey import GraspSearch, objects_for, search_grasps
from fingergait.adopt.view import Coupling, FingerView, HandView, view_of

__all__ = [
    "Coupling",
    "FingerView",
    "Found",
    "Grasp",
    "GraspSearch",
    "HandView",
    "ObjectSpec",
    "SearchOptions",
    "objects_for",
    "search_grasps",
    "search_object",
    "view_of",
    "write_map",
]
