"""Why a proof of existence is none."""


class Refused(Exception):
    """Why a proof is none."""
