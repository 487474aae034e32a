"""The command line; nothing else imports it."""

from .app import main

__all__ = ["main"]
