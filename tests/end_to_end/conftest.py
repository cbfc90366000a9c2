"""Fixtures of the tests of whole robots."""

from second_user import second_user

__all__ = ["second_user"]
