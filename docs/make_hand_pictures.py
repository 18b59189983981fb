"""Make the picture of a hand on the page about hands, docs/img/hand-show.png.

python docs/make_hand_pictures.py
"""

from __future__ import annotations

from pathlib import Path

from handfast import load_hand
from handfast.pictures.drawing import picture
from handfast.pictures.hand_facts import facts_of, shown_hand
from handfast.pictures.hand_picture import draw_hand

IMAGE = Path(__file__).parent / "img" / "hand-show.png"
CLOSED = 0.35  # of the way from open to closed


def main() -> None:
    facts = facts_of(load_hand("schunk-sah"))
    assert facts.palm is not None
    q = facts.palm.opened + CLOSED * (facts.palm.closed - facts.palm.opened)
    IMAGE.write_bytes(picture(draw_hand(shown_hand(facts, q=q)), "png", dpi=150))
    print(f"{IMAGE}: {IMAGE.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
