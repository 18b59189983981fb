"""Hands: the model and its loaders."""

from handfast.model.hand.hand import Coupling, Hand, Joint, Link, guess_closing
from handfast.model.hand.load import bundled_hands, load_hand
from handfast.model.shape import Shape

__all__ = ["Coupling", "Hand", "Joint", "Link", "Shape", "bundled_hands", "guess_closing", "load_hand"]
