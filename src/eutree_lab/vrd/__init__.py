"""Variable resolution discretization: a grid of corners that is refined where it matters."""
