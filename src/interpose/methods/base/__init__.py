"""interpose's own networks as methods; they think at 30 fps on 22 joints scaled to one leg."""

from interpose.methods.base.method import Base, base, small, small_open

__all__ = ["Base", "base", "small", "small_open"]
