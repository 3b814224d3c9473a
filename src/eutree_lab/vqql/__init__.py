"""VQQL: Q-learning over a codebook, one in each leaf."""

from eutree_lab.vqql.method import VectorQuantizationMethod

__all__ = ["VectorQuantizationMethod"]
