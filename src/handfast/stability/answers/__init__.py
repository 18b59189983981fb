"""The queries about one disturbance, a module each: what is asked, its answer and its JSON.

What an answer claims, and how that is replayed, is in `handfast.proofs.answers`.
"""

from __future__ import annotations

from handfast.stability.answers.check_query import CheckAnswer as CheckAnswer
from handfast.stability.answers.max_query import MaxAnswer as MaxAnswer
from handfast.stability.answers.torques_query import TorquesAnswer as TorquesAnswer
