"""Hands: links, joints, couplings, loops, laws of joints, anatomy."""

from handfast.model.hand.hand import Coupling, Hand, Joint, Link, guess_closing
from handfast.model.shape import Shape

__all__ = ["Coupling", "Hand", "Joint", "Link", "Shape", "guess_closing"]
