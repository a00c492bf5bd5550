"""What a hand is: from its MJCF to the model that the compiled core reads."""

from fingergait.hand.mjcf import Finger, compile_spec, find_fingers, hand_json, hand_spec, last_link, load_spec

__all__ = ["Finger", "compile_spec", "find_fingers", "hand_json", "hand_spec", "last_link", "load_spec"]
