"""Parti-game: cells that are cut where no way to the goal is known."""
