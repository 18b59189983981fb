"""Cases of contacts and actuators, and kinds of rows, numbered once: searches import them, too.

Each has a plain integer of its name beside it: compiled code takes no other, and arrays are compared with it five times
as quickly. The numbers 22 and 23 are free for bounds of a search's own, which no certificate may cite.
"""

from __future__ import annotations

from enum import IntEnum

TURN_DIRECTIONS = 2**24  # directions in a full turn
CONE_WIDENING = 2.0**-40  # relative; rows of the cone, and bounds on |d_t|, give way by as much: see `rows.row_values`


class ContactState(IntEnum):
    """The case of a contact."""

    UNDECIDED = 0
    OPEN = 1  # c = 0, d^_n >= 0; with a sector: -d_t in its cone
    CLOSED = 2  # c_n = -d^_n >= 0; with a sector, of half a turn at most: -d_t and c_t in its cone
    STICK = 3  # closed, d_t = 0; with a sector: c_t in its cone
    SLIDE = 4  # closed, -d_t in the sector's cone and c_t = mu c_n along it


UNDECIDED, OPEN, CLOSED, STICK, SLIDE = map(int, ContactState)


class ActuatorState(IntEnum):
    """The case of an actuator."""

    FREE = 0
    LOCKED = 1  # t = 0
    MOVES = 2  # t >= 0, f = f_c
    # of those whose largest command T is sought:
    HIGH = 3  # t = 0, f >= T
    LOW = 4  # t = 0, f <= 0
    BELOW = 5  # LOW or MOVES: f <= T
    ABOVE = 6  # HIGH or MOVES: f >= 0


FREE, LOCKED, MOVES, HIGH, LOW, BELOW, ABOVE = map(int, ActuatorState)


class Row(IntEnum):
    """An inequality: contact i or actuator j, directions a and b, value >= 0; `legal` says when it holds.

    g = -(U_a + U_b) . d_t / (1 + U_a . U_b), which is |d_t| or more where -d_t is between U_a and U_b.
    """

    CN_UP = 0  # c_n
    CN_DOWN = 1  # -c_n
    GAP_UP = 2  # c_n + cos(eta) d_n + sin(eta) g
    GAP_DOWN = 3  # -(c_n + cos(eta) d_n - sin(eta) U_a . d_t)
    DN_UP = 4  # cos(eta) d_n + sin(eta) g
    TANGENT = 5  # mu c_n - U_a . c_t
    CHORD = 6  # ((U_a + U_b) . c_t - mu (1 + U_a . U_b) c_n) / 2
    C_LEFT = 7  # U_a x c_t
    C_RIGHT = 8  # c_t x U_b
    D_LEFT = 9  # U_a x -d_t
    D_RIGHT = 10  # -d_t x U_b
    STILL_1_UP = 11  # d_t1
    STILL_1_DOWN = 12  # -d_t1
    STILL_2_UP = 13  # d_t2
    STILL_2_DOWN = 14  # -d_t2
    T_UP = 15  # t
    T_DOWN = 16  # -t
    E_UP = 17  # f - f_c; f if driven
    E_DOWN = 18  # f_c - f
    S_UP = 19  # T - f, or e_j - f if the sum of commands is sought
    BOUND_UP = 20  # x_k - lo_k, k in `Columns`
    BOUND_DOWN = 21  # hi_k - x_k
    ENERGY = 24  # w . r + f_c . t + g . q - sum of (2 x_i c_n,i - x_i^2); x and the scalar of f_c from `references`
    # of soft fingers, with c_f = (c_t1, c_t2, torsion over lever) and d_f = (d_t1, d_t2, turning):
    SOFT_TANGENT = 25  # mu c_n - (cos b cos a, cos b sin a, sin b) . c_f
    SOFT_CHORD = 26  # w . c_f - h mu c_n, middle w and reach h of patch a
    C_SIDE = 27  # n . c_f, normal n of side b of patch a
    D_SIDE = 28  # -n . d_f
    TURN_UP = 29  # turning
    TURN_DOWN = 30  # -turning
    S_DOWN = 31  # f - T, of an actuator whose largest command T is sought


(
    CN_UP, CN_DOWN, GAP_UP, GAP_DOWN, DN_UP, TANGENT, CHORD, C_LEFT, C_RIGHT, D_LEFT, D_RIGHT, STILL_1_UP,
    STILL_1_DOWN, STILL_2_UP, STILL_2_DOWN, T_UP, T_DOWN, E_UP, E_DOWN, S_UP, BOUND_UP, BOUND_DOWN, ENERGY,
    SOFT_TANGENT, SOFT_CHORD, C_SIDE, D_SIDE, TURN_UP, TURN_DOWN, S_DOWN,
) = map(int, Row)  # fmt: skip
