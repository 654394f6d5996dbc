"""The `simnav` command: `application` puts it together, every other module is one command or what commands share."""

from __future__ import annotations

from .application import app, main

__all__ = ["app", "main"]
