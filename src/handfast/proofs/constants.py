"""Numbers that searches use, too. Nothing is imported here: who reads a grasp or a hand need not load python-flint."""

from __future__ import annotations

import math

MAX_GRASP_SIZE = 249  # contacts, joints, actuators, couplings at most
MIN_LEVER = 1e-7  # [m] of a soft finger, torsion over friction, is above this and below its inverse
MAX_ETA = math.radians(45.0)
SIZE_COUNTS = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "mesh": 0}  # numbers that a size has
END_TOLERANCE = 1e-6  # relative: what is so near the end of a search is at it
RADIAN_LENGTH = 0.1  # [m] that counts as much as a radian in the distance of configurations
