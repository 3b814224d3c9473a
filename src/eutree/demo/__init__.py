"""The whole main job once: what ``eutree demo`` does."""
