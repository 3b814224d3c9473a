"""VQQL: Q-learning over a codebook, one in each leaf."""
