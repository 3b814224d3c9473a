"""Parti-game: cells that are cut where no way to the goal is known."""

from eutree_lab.parti_game.method import PartiGameMethod

__all__ = ["PartiGameMethod"]
