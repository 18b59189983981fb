"""Holdfast: will this grasp hold? Passive grasp stability with proofs, for real hands."""
