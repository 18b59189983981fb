"""What has to be believed: questions and claims as files state them, the equations of both papers, and every checker.

Closed: it imports itself, numpy and python-flint, nothing else. Nothing of a search, of a solver or of geometry is
here, and nothing that a file says bounds what is checked. `python -m handfast.proofs FILE` prints the claim of a saved
answer and its verdict.
"""
