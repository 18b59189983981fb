"""The picture of a dataset's labels: zeros stand apart, numbers of contacts are numbers."""

from __future__ import annotations

from collections import Counter

from handfast.datasets.labels.label_columns import SPREAD_BINS, LabelSummary
from handfast.pictures.label_picture import draw_labels


def test_zeros_and_numbers_of_contacts_keep_their_distance() -> None:
    summary = LabelSummary(
        rows=9, labelled=9, verdicts=Counter(holds=5, slips=4), contacts=Counter({3: 5, 11: 3, 14: 1})
    )
    bins = [0] * SPREAD_BINS
    bins[0], bins[29], bins[31] = 4, 2, 3
    summary.spread["weight_factor"] = {"slips": bins}
    contacts, factors, forces, _ = draw_labels(summary, "a.jsonl").axes
    assert [round(bar.get_x() + bar.get_width() / 2) for bar in contacts.patches] == [3, 11, 14]
    bars = [bar for bar in factors.patches if bar.get_height()]
    zero, first, last = sorted((bar.get_x(), bar.get_height()) for bar in bars)
    assert (zero[1], first[1], last[1]) == (4, 2, 3)
    wide = bars[0].get_width()
    assert 2.5 * wide < first[0] - zero[0] < 3.5 * wide  # apart, but not by all the powers of ten between
    assert factors.get_xticklabels()[0].get_text() == "up to 0.0013"
    assert [text.get_text() for text in forces.texts] == ["none"]
