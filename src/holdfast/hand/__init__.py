"""Hands: the model and its loaders."""

from holdfast.hand.load import bundled_hands, load_hand
from holdfast.hand.model import Coupling, Hand, Joint, Link, guess_closing
from holdfast.shape import Shape

__all__ = ["Coupling", "Hand", "Joint", "Link", "Shape", "bundled_hands", "guess_closing", "load_hand"]
