"""What a hand is: from a model's file to the model that the compiled core reads."""

from fingergait.hand.chains import geom_name
from fingergait.hand.importer import Finger, Hand, compile_spec, import_hand, load_spec, shown
from fingergait.hand.model import hand_json, hand_spec, last_link, model_json
from fingergait.hand.obstacle import HandError, Obstacle
from fingergait.hand.rewrite import OURS

__all__ = [
    "OURS",
    "Finger",
    "Hand",
    "HandError",
    "Obstacle",
    "compile_spec",
    "geom_name",
    "hand_json",
    "hand_spec",
    "import_hand",
    "last_link",
    "load_spec",
    "model_json",
    "shown",
]
